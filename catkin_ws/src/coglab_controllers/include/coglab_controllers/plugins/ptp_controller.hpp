/// @file
/// The point-to-point plug-in (D4.10, Table 5): a queue of synchronised joint motions.
#pragma once

#include <atomic>
#include <vector>

#include "coglab_controllers/motion/motion_runner.hpp"
#include "coglab_controllers/motion/predicted_path.hpp"
#include "coglab_controllers/ptp/ptp_trajectory.hpp"

namespace coglab_controllers {

/// Arguments of add_ptp.
struct PtpRequest {
  std::vector<double> position;  ///< rad, seven joints in wire order
  std::vector<double> max_vel;   ///< rad/s; empty: the robot's limits times default_speed
  std::vector<double> max_acc;   ///< rad/s^2; empty: the robot's limits times default_acceleration
};

/// The same, checked and complete.
struct PtpTarget {
  JointVector position = JointVector::Zero();
  JointVector velocity = JointVector::Zero();
  JointVector acceleration = JointVector::Zero();
};

/// A motion as it is, for the rest of its path.
struct PtpSnapshot {
  std::int64_t stamp_ns = 0;
  int id = -1;
  PtpTrajectory trajectory;
  double time = 0.0;  ///< s, on the trajectory
  double rate = 1.0;  ///< 0..1, of its clock
};

/// The plug-in. Parameters: Table 5's `Kp` (1/s) and `max_queue`; and `default_speed`,
/// `default_acceleration` (shares of the robot's limits), `tolerance` (rad), `settle_time` (s),
/// `hold_blend` (s).
class PtpController : public MotionRunner<PtpTarget> {
 public:
  PtpController();

  /// add_ptp; any thread.
  MotionAnswer add(const PtpRequest& request);

  /// @name Results, one reader thread
  /// @{
  /// Asks for the path of the motion under way; readPath() has it after the next cycle of one.
  void askPath() { snapshots_.ask(); }
  /// Path of the hand in the robot's base frame. Whether one has come since the last call.
  bool readPath(PredictedPath& path);
  /// Whether a motion is under way.
  bool moving() const { return moving_.load(std::memory_order_relaxed); }
  const std::string& baseFrame() const { return setup().robot->chain.baseLink(); }
  /// @}

  void configure(const MotionSetup& setup) override;

 private:
  void report(std::int64_t stamp_ns) override;
  Answer readTarget(const PtpRequest& request, PtpTarget& target) const;

  double tolerance_ = 0.002;  // rad, as ReferenceLoop has it
  double default_speed_ = 0.3, default_acceleration_ = 0.2;
  std::atomic<bool> moving_{false};
  CopyOnRequest<PtpSnapshot> snapshots_;
};

}  // namespace coglab_controllers
