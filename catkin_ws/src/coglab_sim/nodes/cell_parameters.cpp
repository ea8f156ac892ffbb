#include "cell_parameters.hpp"

#include <ros/package.h>
#include <ros/param.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <stdexcept>

namespace coglab_sim {
namespace {

ParameterValue valueOf(const std::string& name, XmlRpc::XmlRpcValue& value) {
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeBoolean:
      return static_cast<bool>(value);
    case XmlRpc::XmlRpcValue::TypeInt:
      return static_cast<int>(value);
    case XmlRpc::XmlRpcValue::TypeDouble:
      return static_cast<double>(value);
    case XmlRpc::XmlRpcValue::TypeString:
      return static_cast<std::string>(value);
    case XmlRpc::XmlRpcValue::TypeArray: {
      std::vector<double> list;
      for (int i = 0; i < value.size(); ++i) {
        const ParameterValue entry = valueOf(name, value[i]);
        if (const auto* number = std::get_if<double>(&entry)) {
          list.push_back(*number);
        } else if (const auto* whole = std::get_if<int>(&entry)) {
          list.push_back(*whole);
        } else {
          throw std::invalid_argument("parameter " + name + ": expected a list of numbers");
        }
      }
      return list;
    }
    default:
      throw std::invalid_argument("parameter " + name +
                                  " has a type that no parameter of the cell has");
  }
}

/// Sets `name` of the table from `key` under the node, if it is there.
void take(CellConfig& config, const ros::NodeHandle& node, const std::string& key,
          const std::string& name) {
  XmlRpc::XmlRpcValue value;
  if (node.getParam(key, value))
    setCellParameter(config, name, valueOf(node.resolveName(key), value));
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
  take(config, above, "fri_period", "krc/period");
  take(config, above, "seed", "seed");
  config.object = readObject(node, node.param<std::string>("object/id", config.object.id));
  config.object_pose.position[2] = -config.object.center[2];  // held at the height of its middle
  for (const CellParameter& parameter : cellParameters())
    take(config, node, parameter.name, parameter.name);
  return config;
}

plant::Object readObject(const ros::NodeHandle& node, const std::string& id) {
  if (id.find('/') != std::string::npos)
    throw std::invalid_argument("object id '" + id + "': expected the name of an object file");
  const auto folder =
      node.param<std::string>("objects", ros::package::getPath("coglab_objects") + "/objects");
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
