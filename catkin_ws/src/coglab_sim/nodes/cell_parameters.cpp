#include "cell_parameters.hpp"

#include <ros/package.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <stdexcept>
#include <type_traits>

#include "coglab_rt/ros/parameter.hpp"

namespace coglab_sim {
namespace {

/// What a value is expected to be, in words.
template <typename T>
constexpr const char* expected() {
  if constexpr (std::is_same_v<T, bool>) return "true or false";
  if constexpr (std::is_same_v<T, std::string>) return "a text";
  if constexpr (std::is_same_v<T, std::vector<double>>) return "a list of numbers";
  return "a number";
}

/// Sets a row of the table from the parameter `key` under the node, if it is there: as the type
/// that the row has.
void take(CellConfig& config, const ros::NodeHandle& node, const CellParameter& row,
          const std::string& key) {
  if (!node.hasParam(key)) return;
  const auto read = [&](const auto& otherwise) -> ParameterValue {
    using T = std::decay_t<decltype(otherwise)>;
    return coglab_rt::readParameter<T>(node, key.c_str(), otherwise, expected<T>());
  };
  row.set(config, std::visit(read, row.get(config)));
}

double numberOf(const YAML::Node& entry, const char* field) {
  const auto value = entry[field].as<double>(std::nan(""));
  if (!std::isfinite(value))
    throw std::invalid_argument(std::string(field) + ": expected a number");
  return value;
}

}  // namespace

CellConfig readCellConfig(const ros::NodeHandle& node) {
  CellConfig config;
  config.urdf = ros::package::getPath("lwr_description") + "/urdf/lwr_ih2.urdf";
  const ros::NodeHandle above;
  config.object =
      readObject(node, coglab_rt::readParameter(node, "object/id", config.object.id, "a name"));
  config.object_pose.position[2] = -config.object.center[2];  // held at the height of its middle
  for (const CellParameter& row : cellParameters()) {
    if (row.name == "krc/period") take(config, above, row, "fri_period");
    if (row.name == "seed") take(config, above, row, "seed");
    take(config, node, row, row.name);
  }
  return config;
}

plant::Object readObject(const ros::NodeHandle& node, const std::string& id) {
  if (id.find('/') != std::string::npos)
    throw std::invalid_argument("object id '" + id + "': expected the name of an object file");
  const auto folder = coglab_rt::readParameter<std::string>(
      node, "objects", ros::package::getPath("coglab_objects") + "/objects", "a path");
  const std::string path = folder + "/" + id + ".yaml";
  try {
    const YAML::Node entry = YAML::LoadFile(path);
    CellConfig config;
    setCellParameter(config, "object/mass", numberOf(entry, "mass"));
    setCellParameter(config, "object/friction", numberOf(entry, "friction"));
    setCellParameter(config, "object/shape", entry["shape"]["type"].as<std::string>());
    setCellParameter(config, "object/size", entry["size"].as<std::vector<double>>());
    config.object.center = Vector3d(0.0, 0.0, config.object.size[2] / 2);
    config.object.id = id;
    return config.object;
  } catch (const std::exception& error) {
    throw std::invalid_argument(
        "object '" + id + "': " + path + " cannot be used (" + error.what() +
        "); expected a file of the object database, ./coglab object check " + id);
  }
}

}  // namespace coglab_sim
