/// @file
/// Reads a ROS parameter. A value of another type is an error and not silently the default. Only
/// for nodes that depend on roscpp: outside of this folder coglab_rt is independent of ROS.
#pragma once

#include <ros/node_handle.h>

#include <sstream>
#include <stdexcept>
#include <string>

namespace coglab_rt {

/// The parameter, or `otherwise` if it is not set.
/// @param expected description of the expected value.
/// @throws std::invalid_argument naming the parameter if it has another type.
template <typename T>
T readParameter(const ros::NodeHandle& node, const char* name, const T& otherwise,
                const char* expected) {
  T value = otherwise;
  if (node.hasParam(name) && !node.getParam(name, value)) {
    throw std::invalid_argument("parameter " + node.resolveName(name) + ": expected " + expected);
  }
  return value;
}

/// The parameter with this name in the nearest namespace above the node, or `otherwise` if there is
/// none.
/// @throws std::invalid_argument naming the parameter if it has another type.
template <typename T>
T readNearest(const ros::NodeHandle& node, const char* name, const T& otherwise,
              const char* expected) {
  std::string found;
  if (!node.searchParam(name, found)) return otherwise;
  return readParameter<T>(node, found.c_str(), otherwise, expected);
}

/// A number between low and high.
/// @throws std::invalid_argument naming parameter, value and range.
inline double readNumber(const ros::NodeHandle& node, const char* name, double otherwise,
                         double low, double high) {
  const double value = readParameter<double>(node, name, otherwise, "a number");
  if (value >= low && value <= high) return value;
  std::ostringstream text;
  text << "parameter " << node.resolveName(name) << " = " << value << " is outside its range "
       << low << ".." << high;
  throw std::invalid_argument(text.str());
}

}  // namespace coglab_rt
