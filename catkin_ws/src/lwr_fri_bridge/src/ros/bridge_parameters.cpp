#include <cmath>
#include <stdexcept>

#include "coglab_rt/ros/joint_limits_parameter.hpp"
#include "coglab_rt/ros/parameter.hpp"
#include "lwr_fri_bridge/ros/bridge_ros.hpp"

namespace lwr_fri_bridge {
namespace {

using coglab_rt::readParameter;

double numberParameter(const ros::NodeHandle& nh, const char* name, double otherwise) {
  return readParameter<double>(nh, name, otherwise, "a number");
}

int wholeParameter(const ros::NodeHandle& nh, const char* name, int otherwise, int low, int high) {
  const int value = readParameter<int>(nh, name, otherwise, "a whole number");
  checkParameter(name, value, low, high);
  return value;
}

}  // namespace

BridgeConfig readBridgeConfig(const ros::NodeHandle& nh) {
  BridgeConfig config;
  config.limits =
      coglab_rt::readJointLimits(nh, "limits_file", "limits_profile", "lwr_description");
  config.krl_convention = fri::krlConventionFromName(
      readParameter<std::string>(nh, "krl_convention", "coglab", "a name"));
  config.tool_number = readParameter<int>(nh, "tool_number", config.tool_number, "a whole number");
  config.lenient_headers =
      readParameter<bool>(nh, "lenient_headers", config.lenient_headers, "true or false");
  const Event mode = parseEvent(
      readParameter<std::string>(nh, "control_mode", "position", "an event"), config.mode);
  if (mode.kind != EventKind::Mode) {
    throw std::invalid_argument(
        "parameter " + nh.resolveName("control_mode") +
        ": expected position, joint_impedance or cartesian_impedance with their parameters");
  }
  config.mode = mode.mode;
  config.position_margin = numberParameter(nh, "position_margin", config.limits.position_margin);
  config.leash.position = numberParameter(nh, "set_point_leash/position", config.leash.position);
  config.leash.impedance = numberParameter(nh, "set_point_leash/impedance", config.leash.impedance);
  config.leash.load = numberParameter(nh, "set_point_leash/load", config.leash.load);
  const auto axes = readParameter<std::string>(nh, "wrench_axes", "base", "base or tool");
  if (axes != "base" && axes != "tool") {
    throw std::invalid_argument("parameter " + nh.resolveName("wrench_axes") + " = " + axes +
                                ": expected base or tool");
  }
  config.wrench_in_tool_axes = axes == "tool";
  config.velocity_filter_time =
      numberParameter(nh, "velocity_filter_time", config.velocity_filter_time);
  config.command_timeout = numberParameter(nh, "command_timeout", config.command_timeout);
  config.topic_timeout = numberParameter(nh, "topic_timeout", config.topic_timeout);
  config.receive_timeout = numberParameter(nh, "receive_timeout", config.receive_timeout);
  config.requests.start_timeout =
      numberParameter(nh, "start_timeout", config.requests.start_timeout);
  config.requests.stop_timeout = numberParameter(nh, "stop_timeout", config.requests.stop_timeout);
  config.requests.silent_stop_timeout =
      numberParameter(nh, "silent_stop_timeout", config.requests.silent_stop_timeout);
  config.check();
  return config;
}

FriThreadOptions readFriThreadOptions(const ros::NodeHandle& nh) {
  FriThreadOptions options;
  options.address =
      readParameter<std::string>(nh, "fri_address", options.address, "an IPv4 address");
  options.port = wholeParameter(nh, "fri_port", options.port, 0, 65535);
  options.controller_address = readParameter<std::string>(
      nh, "controller_address", options.controller_address, "an IPv4 address or nothing");
  options.priority = wholeParameter(nh, "rt_priority", options.priority, 0, 98);
  options.stack_bytes =
      1024 * static_cast<std::size_t>(wholeParameter(nh, "rt_stack_kib", 256, 128, 8192));
  return options;
}

}  // namespace lwr_fri_bridge
