#include "coglab_controllers/ros/ros_parameters.hpp"
#include "coglab_rt/joint_limits_table.hpp"

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include <ros/package.h>
#include <xmlrpcpp/XmlRpcValue.h>

namespace coglab_controllers {

namespace {

YAML::Node convert(XmlRpc::XmlRpcValue& value) {
  YAML::Node node;
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeBoolean:
      return YAML::Node(static_cast<bool>(value));
    case XmlRpc::XmlRpcValue::TypeInt:
      return YAML::Node(static_cast<int>(value));
    case XmlRpc::XmlRpcValue::TypeDouble:
      return YAML::Node(static_cast<double>(value));
    case XmlRpc::XmlRpcValue::TypeString:
      return YAML::Node(static_cast<std::string>(value));
    case XmlRpc::XmlRpcValue::TypeArray:
      node = YAML::Node(YAML::NodeType::Sequence);
      for (int i = 0; i < value.size(); ++i) node.push_back(convert(value[i]));
      return node;
    case XmlRpc::XmlRpcValue::TypeStruct:
      node = YAML::Node(YAML::NodeType::Map);
      for (auto& entry : value) node[entry.first] = convert(entry.second);
      return node;
    default:
      return node;
  }
}

std::string readFile(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("file '" + path + "' cannot be read; check its path");
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// `package://name/path` as a path; other names below this package's config folder.
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
  return ros::package::getPath("coglab_controllers") + "/config/" + name;
}

std::string robotModel(const ros::NodeHandle& node, const Parameters& parameters) {
  const std::string file = parameters.text("urdf_file", "");
  if (!file.empty()) return readFile(file);
  std::string key, model;
  if (node.searchParam("robot_description", key) && node.getParam(key, model)) return model;
  return readFile(ros::package::getPath("lwr_description") + "/urdf/lwr_ih2.urdf");
}

}  // namespace

YAML::Node readParameters(const ros::NodeHandle& node) {
  XmlRpc::XmlRpcValue value;
  if (!node.getParam("", value) && !node.getParam(node.getNamespace(), value)) {
    return YAML::Node(YAML::NodeType::Map);
  }
  return value.getType() == XmlRpc::XmlRpcValue::TypeStruct ? convert(value)
                                                            : YAML::Node(YAML::NodeType::Map);
}

coglab_rt::JointLimits readJointLimits(const ros::NodeHandle& node) {
  const Parameters parameters(readParameters(node), "controller_manager");
  const std::string table = parameters.text(
      "joint_limits_file", ros::package::getPath("lwr_description") + "/config/joint_limits.yaml");
  return coglab_rt::loadJointLimits(table, parameters.text("joint_limits_profile", "default"));
}

ManagerSettings readManagerSettings(const ros::NodeHandle& node) {
  const YAML::Node tree = readParameters(node);
  const Parameters parameters(tree, "controller_manager");
  ManagerSettings settings =
      readManagerSettings(tree, robotModel(node, parameters), readJointLimits(node), false);
  settings.feedback_file = resolve(settings.feedback_file);
  return settings;
}

}  // namespace coglab_controllers
