/// @file
/// An ideal arm: it follows its commanded velocities exactly, within the robot's limits. It has no
/// robot controller, no physics and no ROS; for the development of controllers.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "coglab_rt/arm_port.hpp"
#include "coglab_rt/braking.hpp"
#include "coglab_rt/interpolator.hpp"
#include "coglab_rt/joint_limits.hpp"
#include "coglab_rt/reason.hpp"

namespace coglab_controllers {

/// Configuration of the ideal arm.
struct IdealArmConfig {
  coglab_rt::JointLimits limits;
  /// rad, inside the limits; the default is the home posture of the simulated cell.
  coglab_rt::Vector7 start_position =
      (coglab_rt::Vector7() << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782).finished();
  double period = 0.005;          ///< s between two measurements, 0.001..0.1
  double command_timeout = 0.05;  ///< s, age at which a command ends, 0.005..1

  /// @throws std::invalid_argument naming the parameter, its value and its range
  void check() const;
};

/// State of the ideal arm.
enum class IdealArmState : std::uint8_t { Monitor, Command, Holding, Stopping };

/// Returns monitor, command, holding or stopping, as in coglab_msgs/LwrState.
const char* nameOf(IdealArmState state);

/// The newest measurement with the state, for publishing.
struct IdealArmView {
  coglab_rt::RobotSample sample;
  IdealArmState state = IdealArmState::Monitor;
  bool hold_latched = false;
};

/// Integrates the newest velocity command within the limits of velocity, acceleration and jerk. It
/// stops before the ends of the joint ranges with the same reserve as the real arm. Motion is
/// permitted as on the real arm, too: between `start` and `stop`, not while `hold` is latched, and
/// only for commands that were computed in the present permission.
class IdealArm {
 public:
  /// @throws std::invalid_argument as IdealArmConfig::check()
  explicit IdealArm(const IdealArmConfig& config);

  coglab_rt::ArmMailboxes& mailboxes() { return mailboxes_; }
  const IdealArmConfig& config() const { return config_; }

  /// Makes one step and one sample; the arm's thread calls it once per period. No allocation, lock,
  /// system call or exception. @param now_ns steady clock
  void tick(std::int64_t now_ns) noexcept;

  /// Handles start, stop, hold, reset or position (the only mode of this arm). It takes effect at
  /// the next tick(). Any thread. @return accepted or refused; `message` has the reason
  coglab_rt::Answer request(const std::string& event);
  /// Number of requests, and of requests that a tick has processed. Any thread.
  std::uint32_t requested() const { return requested_.load(std::memory_order_acquire); }
  std::uint32_t served() const { return served_.load(std::memory_order_acquire); }
  /// True if the arm stood at the end of the last tick. Any thread.
  bool stands() const { return stands_.load(std::memory_order_acquire); }

  /// Reads the newest view; returns true if it is newer than the last one read. One reader.
  bool newestView(IdealArmView& view) { return views_.read(view); }

 private:
  coglab_rt::Vector7 targetVelocity(std::int64_t now_ns) noexcept;
  void judge() noexcept;
  coglab_rt::Answer take(const std::string& event);

  const IdealArmConfig config_;
  coglab_rt::ArmMailboxes mailboxes_;
  coglab_rt::TripleBuffer<IdealArmView> views_;
  std::atomic<bool> started_{false}, held_{false};
  std::atomic<std::uint32_t> holds_{0}, requested_{0}, served_{0};
  std::atomic<bool> stands_{true};

  // arm's thread
  coglab_rt::Interpolator interpolator_;
  coglab_rt::BrakingGuard braking_;
  coglab_rt::VelocityCommand command_;
  IdealArmView view_;
  std::uint32_t holds_seen_ = 0;
  bool brakes_ = false;  // for a hold, until the arm stands, even after an early reset
};

}  // namespace coglab_controllers
