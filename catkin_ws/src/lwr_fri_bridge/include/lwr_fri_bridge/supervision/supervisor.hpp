/// @file
/// Supervisor (D4.10 Figure 1): the quick state machine that says whether motion is allowed.
///
/// It never waits: what takes time (entering and leaving command mode) is the Configurator's, which
/// runs beside it, so `hold` acts in the tick in which it arrives, whatever else is going on.
#pragma once

#include <cstdint>

#include "lwr_fri_bridge/names.hpp"

namespace lwr_fri_bridge {

enum class SupervisorState : std::uint8_t {
  Disconnected,  ///< no datagrams
  Monitor,       ///< monitor mode, nothing asked
  Starting,      ///< the configurator works on a start
  Command,       ///< started; target velocities are followed
  Holding,       ///< hold is latched
  Stopping,      ///< braking, or waiting for monitor mode
  Stopped        ///< fell back, lost power, poor quality, drive error, or command mode came
                 ///< unasked; needs `start`
};

/// "disconnected", "monitor", ... as in LwrState.
const char* nameOf(SupervisorState state);

/// What one tick shows of the robot.
struct SupervisorInput {
  bool connected = false;
  bool fresh_session = false;  ///< the controller's counter began anew
  bool command_mode = false;
  bool full_power = false;
  bool quality_unacceptable = false;
  bool drive_error = false;
  bool stands_still = false;  ///< the interpolator stands
  bool leashed = false;       ///< SetPointLeash is tripped
};

/// Real-time safe, one thread.
class Supervisor {
 public:
  // Events, from the user or the configurator.
  /// Brakes, at least until the arm stands, even if `reset` comes at once.
  void hold() { held_ = braking_ = true; }
  void reset() { held_ = false; }
  void startBegins();
  void startEnds(bool reached);
  void stopBegins();
  void stopEnds();

  /// Judges one tick.
  void update(const SupervisorInput& input);

  SupervisorState state() const { return state_; }
  MotionBlock block() const { return block_; }
  std::uint32_t epoch() const { return epoch_; }
  bool held() const { return held_; }
  bool starting() const { return starting_; }
  bool stopping() const { return stopping_; }
  /// A stop was asked for and the arm has come to rest (or is not commanded any more): ask for
  /// monitor mode.
  bool readyForMonitor() const { return stopping_ && at_rest_; }
  /// Times that command mode, power, quality or a drive was lost while started.
  std::uint32_t fallBacks() const { return fall_backs_; }

 private:
  MotionBlock judge(const SupervisorInput& input) const;

  bool held_ = false;
  bool braking_ = false;  // for a hold, until the arm stands
  bool started_ = false;
  bool starting_ = false;
  bool stopping_ = false;
  bool fell_back_ = false;
  bool at_rest_ = false;
  std::uint32_t fall_backs_ = 0;
  std::uint32_t epoch_ = 0;
  MotionBlock block_ = MotionBlock::Disconnected;
  MotionBlock stopped_by_ = MotionBlock::NotStarted;  // why it needs a start
  SupervisorState state_ = SupervisorState::Disconnected;
};

}  // namespace lwr_fri_bridge
