/// @file
/// Parameters of the bridge, with their ranges.
#pragma once

#include "lwr_fri_bridge/motion/set_point_leash.hpp"
#include "lwr_fri_bridge/names.hpp"
#include "lwr_fri_bridge/requests/configurator.hpp"

namespace lwr_fri_bridge {

struct BridgeConfig {
  JointLimits limits;  ///< from coglab_rt::loadJointLimits()
  fri::KrlConvention krl_convention = fri::KrlConvention::Coglab;
  int tool_number = 1;                  ///< sent to the KRL program of rtt_lwr
  bool lenient_headers = false;         ///< accept controllers that send zeros in the header
  ControlMode mode;                     ///< initial control mode; events can change it
  double position_margin = 0.01;        ///< rad from both ends of every joint's range, 0..0.5
  LeashLengths leash;                   ///< bound of |commanded - measured| per joint
  bool wrench_in_tool_axes = false;     ///< true: KRL sets $STIFFNESS.TASKFRAME to #TOOL
  double velocity_filter_time = 0.008;  ///< s, time constant of the velocity filter, 0..0.2
  double command_timeout = 0.05;  ///< s, longest age of a command of the control thread, 0.005..1
  double topic_timeout = 0.1;     ///< s, the same for commands from target_joint_states
  double receive_timeout =
      0.25;  ///< s of silence (at least 5 cycles) until `disconnected`, 0.05..5
  ConfiguratorLimits requests;

  /// @throws std::invalid_argument with the parameter, its value and its range.
  void check() const;
};

/// Throws std::invalid_argument "name = value is outside low..high" unless low <= value <= high.
void checkParameter(const char* name, double value, double low, double high);

}  // namespace lwr_fri_bridge
