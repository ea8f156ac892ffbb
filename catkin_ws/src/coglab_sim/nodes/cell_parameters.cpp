#include "cell_parameters.hpp"

#include <ros/package.h>
#include <ros/param.h>

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

}  // namespace

CellConfig readCellConfig(const ros::NodeHandle& node) {
  CellConfig config;
  config.urdf = ros::package::getPath("lwr_description") + "/urdf/lwr_ih2.urdf";
  const ros::NodeHandle above;
  take(config, above, "fri_period", "krc/period");
  take(config, above, "seed", "seed");
  for (const CellParameter& parameter : cellParameters())
    take(config, node, parameter.name, parameter.name);
  if (const std::string id = node.param<std::string>("start_object", ""); !id.empty()) {
    config.object = readObject(node, id);
    config.object_pose.position[2] = -config.object.center[2];  // held at the height of its middle
  }
  return config;
}

plant::Object readObject(const ros::NodeHandle& node, const std::string& id) {
  const std::string prefix = "objects/" + id + "/";
  if (!node.hasParam("objects/" + id)) {
    throw std::invalid_argument("object '" + id + "' has no parameters " +
                                node.resolveName("objects/" + id) +
                                " (mass, shape, size, center, friction)");
  }
  CellConfig config;
  for (const char* field : {"mass", "shape", "size", "center", "friction"}) {
    take(config, node, prefix + field, std::string("object/") + field);
  }
  config.object.id = id;
  return config.object;
}

}  // namespace coglab_sim
