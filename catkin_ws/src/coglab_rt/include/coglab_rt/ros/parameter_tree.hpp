/// @file
/// All ROS parameters below a namespace as one tree, for code that is independent of ROS.
#pragma once

#include <ros/node_handle.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <string>

#include <yaml-cpp/yaml.h>

namespace coglab_rt {

namespace detail {

/// A value of the parameter server as YAML. Types that YAML lacks (dates, bytes) become empty.
inline YAML::Node toYaml(XmlRpc::XmlRpcValue& value) {
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
      for (int i = 0; i < value.size(); ++i) node.push_back(toYaml(value[i]));
      return node;
    case XmlRpc::XmlRpcValue::TypeStruct:
      node = YAML::Node(YAML::NodeType::Map);
      for (auto& entry : value) node[entry.first] = toYaml(entry.second);
      return node;
    default:
      return node;
  }
}

}  // namespace detail

/// All parameters below a namespace; an empty map if there are none.
inline YAML::Node readParameterTree(const ros::NodeHandle& node) {
  XmlRpc::XmlRpcValue value;
  if (!node.getParam("", value) && !node.getParam(node.getNamespace(), value)) {
    return YAML::Node(YAML::NodeType::Map);
  }
  return value.getType() == XmlRpc::XmlRpcValue::TypeStruct ? detail::toYaml(value)
                                                            : YAML::Node(YAML::NodeType::Map);
}

}  // namespace coglab_rt
