/// @file
/// The point-to-point plug-in (D4.10, Table 5): a queue of synchronised joint motions.
#pragma once

#include <vector>

#include "coglab_controllers/motion/motion_runner.hpp"
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

/// The plug-in. Parameters: Table 5's `Kp` (1/s) and `max_queue`; and `default_speed`,
/// `default_acceleration` (shares of the robot's limits), `tolerance` (rad), `settle_time` (s),
/// `hold_blend` (s).
class PtpController : public MotionRunner<PtpTarget> {
 public:
  PtpController();

  /// add_ptp; any thread.
  MotionAnswer add(const PtpRequest& request);

  void configure(const MotionSetup& setup) override;

 private:
  void report(std::int64_t) override {}
  Answer readTarget(const PtpRequest& request, PtpTarget& target) const;

  double tolerance_ = 0.002;  // rad, as ReferenceLoop has it
  double default_speed_ = 0.3, default_acceleration_ = 0.2;
};

}  // namespace coglab_controllers
