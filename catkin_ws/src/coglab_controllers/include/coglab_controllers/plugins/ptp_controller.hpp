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

/// Checked and complete arguments of add_ptp.
struct PtpTarget {
  JointVector position = JointVector::Zero();
  JointVector velocity = JointVector::Zero();
  JointVector acceleration = JointVector::Zero();
};

/// Present state of a motion, to compute the rest of its path.
struct PtpSnapshot {
  std::int64_t stamp_ns = 0;
  int id = -1;
  PtpTrajectory trajectory;
  double time = 0.0;  ///< s, on the trajectory
  double rate = 1.0;  ///< 0..1, clock rate
};

/// The point-to-point plug-in. Parameters: Table 5's `Kp` (1/s) and `max_queue`; and
/// `default_speed`, `default_acceleration` (shares of the robot's limits), `tolerance` (rad),
/// `settle_time` (s), `hold_blend` (s).
class PtpController : public MotionRunner<PtpTarget> {
 public:
  PtpController();

  /// Handles add_ptp. Any thread.
  MotionAnswer add(const PtpRequest& request);

  /// @name Results, one reader thread
  /// @{
  /// Requests the path of the running motion; readPath() returns it after the motion's next cycle.
  void askPath() { snapshots_.ask(); }
  /// Reads the path of the hand, in the robot's base frame. False if there is no new path.
  bool readPath(PredictedPath& path);
  /// True if a motion runs.
  bool moving() const { return moving_.load(std::memory_order_relaxed); }
  const std::string& baseFrame() const { return setup().robot->chain.baseLink(); }
  /// @}

  void configure(const MotionSetup& setup) override;

 private:
  void report(std::int64_t stamp_ns) override;
  Answer readTarget(const PtpRequest& request, PtpTarget& target) const;

  double tolerance_ = 0.002;  // rad, as in ReferenceLoop
  // set by configure()
  const Tunable *default_speed_ = nullptr, *default_acceleration_ = nullptr;
  std::atomic<bool> moving_{false};
  CopyOnRequest<PtpSnapshot> snapshots_;
};

}  // namespace coglab_controllers
