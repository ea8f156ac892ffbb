/// @file
/// Supervisor (D4.10 Figure 1): the fast state machine that decides whether motion is allowed.
///
/// It never waits. The Configurator, which runs in parallel, handles slow requests (entering and
/// leaving command mode). `hold` therefore always acts in the tick in which it arrives.
#pragma once

#include <cstdint>

#include "lwr_fri_bridge/names.hpp"

namespace lwr_fri_bridge {

enum class SupervisorState : std::uint8_t {
  Disconnected,  ///< no datagrams
  Monitor,       ///< monitor mode, no request
  Starting,      ///< the configurator works on a start
  Command,       ///< started; target velocities are followed
  Holding,       ///< hold is latched
  Stopping,      ///< braking, or waiting for monitor mode
  Stopped        ///< fall-back, lost power, poor quality, drive error, or command mode without a
                 ///< request; needs `start`
};

/// "disconnected", "monitor", ... as in LwrState.
const char* nameOf(SupervisorState state);

/// State of the robot in one tick.
struct SupervisorInput {
  bool connected = false;
  bool fresh_session = false;  ///< the controller's counter restarted
  bool command_mode = false;
  bool full_power = false;
  bool quality_unacceptable = false;
  bool drive_error = false;
  bool stands_still = false;  ///< the interpolator is at rest
  bool leashed = false;       ///< SetPointLeash is tripped
};

/// Real-time safe, one thread.
class Supervisor {
 public:
  // Events, from the user or the configurator.
  /// Brakes at least until the arm is at rest, even if `reset` follows at once.
  void hold() { held_ = braking_ = true; }
  void reset() { held_ = false; }
  void startBegins();
  void startEnds(bool reached);
  void stopBegins();
  void stopEnds();

  /// Processes one tick.
  void update(const SupervisorInput& input);

  SupervisorState state() const { return state_; }
  MotionBlock block() const { return block_; }
  std::uint32_t epoch() const { return epoch_; }
  bool held() const { return held_; }
  bool starting() const { return starting_; }
  bool stopping() const { return stopping_; }
  /// True if monitor mode can be requested: a stop is in progress, and the arm is at rest or no
  /// longer commanded.
  bool readyForMonitor() const { return stopping_ && at_rest_; }
  /// Number of losses of command mode, power, quality or a drive while started.
  std::uint32_t fallBacks() const { return fall_backs_; }

 private:
  MotionBlock judge(const SupervisorInput& input) const;

  bool held_ = false;
  bool braking_ = false;  // for a hold, until the arm is at rest
  bool started_ = false;
  bool starting_ = false;
  bool stopping_ = false;
  bool fell_back_ = false;
  bool at_rest_ = false;
  std::uint32_t fall_backs_ = 0;
  std::uint32_t epoch_ = 0;
  MotionBlock block_ = MotionBlock::Disconnected;
  MotionBlock stopped_by_ = MotionBlock::NotStarted;  // reason for Stopped
  SupervisorState state_ = SupervisorState::Disconnected;
};

}  // namespace lwr_fri_bridge
