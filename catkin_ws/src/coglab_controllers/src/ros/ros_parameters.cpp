#include "coglab_controllers/ros/ros_parameters.hpp"

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include <ros/package.h>

#include "coglab_rt/ros/joint_limits_parameter.hpp"
#include "coglab_rt/ros/parameter.hpp"
#include "coglab_rt/ros/parameter_tree.hpp"

namespace coglab_controllers {

namespace {

// Default package of the model and the limits of the arm.
constexpr const char* kDescription = "lwr_description";

std::string readFile(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("file '" + path + "' cannot be read; check its path");
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// Path of `package://name/path`. Other names are below this package's config folder, with `.yaml`
/// if they have no suffix.
std::string resolve(const std::string& name) {
  const std::string scheme = "package://";
  if (name.rfind(scheme, 0) == 0) {
    const std::size_t slash = name.find('/', scheme.size());
    const std::string package = name.substr(scheme.size(), slash - scheme.size());
    const std::string path = ros::package::getPath(package);
    if (path.empty() || slash == std::string::npos) {
      throw std::runtime_error("'" + name + "': package '" + package + "' was not found");
    }
    return path + name.substr(slash);
  }
  if (name.empty() || std::filesystem::path(name).is_absolute()) return name;
  const std::string suffix = std::filesystem::path(name).has_extension() ? "" : ".yaml";
  return ros::package::getPath("coglab_controllers") + "/config/" + name + suffix;
}

std::string robotModel(const ros::NodeHandle& node, const Parameters& parameters) {
  const std::string file = parameters.text("urdf_file", "");
  if (!file.empty()) return readFile(file);
  const auto model =
      coglab_rt::readNearest<std::string>(node, "robot_description", "", "the text of a URDF");
  if (!model.empty()) return model;
  return readFile(ros::package::getPath(kDescription) + "/urdf/lwr_ih2.urdf");
}

}  // namespace

coglab_rt::JointLimits readJointLimits(const ros::NodeHandle& node) {
  return coglab_rt::readJointLimits(node, "joint_limits_file", "joint_limits_profile",
                                    kDescription);
}

ManagerSettings readManagerSettings(const ros::NodeHandle& node) {
  const YAML::Node tree = coglab_rt::readParameterTree(node);
  const Parameters parameters(tree, "controller_manager");
  ManagerSettings settings =
      readManagerSettings(tree, robotModel(node, parameters), readJointLimits(node), false);
  settings.feedback_file = resolve(settings.feedback_file);
  settings.central_file = resolve(settings.central_file);
  settings.signals_file = resolve(settings.signals_file);
  // Only the ROS sides of these controllers are in a library; programs without ROS link them.
  for (const char* stream :
       {"coglab/TwistStream", "coglab/PoseStream", "coglab/JointVelocityStream"})
    settings.types.emplace(stream, "libcoglab_streams.so");
  settings.types.emplace("coglab/JointTrajectory", "libcoglab_joint_trajectory.so");
  return settings;
}

}  // namespace coglab_controllers
