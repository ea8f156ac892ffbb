/// @file
/// State of the bridge for other threads.
#pragma once

#include <array>
#include <cstdint>

#include "lwr_fri_bridge/fri/session.hpp"
#include "lwr_fri_bridge/names.hpp"
#include "lwr_fri_bridge/requests/events.hpp"
#include "lwr_fri_bridge/supervision/command_mode_loss.hpp"
#include "lwr_fri_bridge/supervision/supervisor.hpp"

namespace lwr_fri_bridge {

/// Counters of the bridge since its start, without those of the session.
struct BridgeCounters {
  std::uint64_t commands_invalid = 0;    ///< velocities that were not finite
  std::uint64_t commands_old_epoch = 0;  ///< computed before motion was allowed
  std::uint64_t command_timeouts = 0;    ///< commands stopped while a joint was moving
  std::uint64_t resumed_after_gap = 0;   ///< adopted the controller's set-point after a loss
  std::uint64_t position_bounds = 0;     ///< ticks in which braking distance limited a joint
  std::uint64_t leash_trips = 0;
  std::uint64_t requests_dropped = 0;  ///< events dropped because the request queue was full
};

/// The part of a Snapshot whose changes are published on the topic `state`.
struct StateView {
  SupervisorState supervisor = SupervisorState::Disconnected;
  MotionBlock block = MotionBlock::Disconnected;
  bool hold_latched = false;
  std::int8_t blocking_joint = -1;
  std::uint32_t motion_epoch = 0;  ///< as in RobotSample
  CommandModeLoss loss;            ///< loss of command mode since the last start
  fri::FriState state = fri::FriState::Off;
  fri::Quality quality = fri::Quality::Unacceptable;
  fri::ControlStrategy control = fri::ControlStrategy::Other;  ///< reported by the controller
  std::uint16_t power = 0, drive_error = 0, drive_warning = 0;
  double cycle_time = 0.0;  ///< s

  bool operator==(const StateView& other) const;
};

/// Complete state, copied at the end of each tick.
struct Snapshot : StateView {
  RobotSample sample;
  std::int64_t permission_since_ns = 0;  ///< start of sample.motion_epoch
  fri::SessionCounters session;
  BridgeCounters counters;
  bool request_busy = false;
  std::uint32_t fall_backs = 0;
  ControlMode mode;  ///< control mode for the next start
  float answer_rate = 0, latency = 0, jitter = 0, miss_rate = 0, safety_scale = 0,
        timestamp = 0;  ///< values of the controller
  std::uint32_t miss_counter = 0;
  std::array<float, 7> temperature{};  ///< degree Celsius
  unsigned bounded_joints = 0;  ///< joints limited by braking distance in this tick; bit i: joint i
};

}  // namespace lwr_fri_bridge
