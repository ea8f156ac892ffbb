/// @file
/// The point-to-point plug-in (D4.10, Table 5): a queue of synchronised joint motions.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "coglab_controllers/ik/two_task_ik.hpp"
#include "coglab_controllers/manager/motion_controller.hpp"
#include "coglab_controllers/names.hpp"
#include "coglab_controllers/plugins/hold.hpp"
#include "coglab_controllers/ptp/ptp_trajectory.hpp"

namespace coglab_controllers {

/// Arguments of add_ptp.
struct PtpRequest {
  std::vector<double> position;  ///< rad, seven joints in wire order
  std::vector<double> max_vel;   ///< rad/s; empty: the robot's limits times default_speed
  std::vector<double> max_acc;   ///< rad/s^2; empty: the robot's limits times default_acceleration
};

/// Answer to add_ptp.
struct PtpAnswer {
  static constexpr int kStarted = 0, kQueued = 1, kRejected = 2;  ///< status

  int status = kRejected;
  int ptp_id = -1;
  ReasonCode code = ReasonCode::None;
  std::string message;  ///< why it was rejected
};

/// A motion that ended.
struct PtpEnd {
  int ptp_id = -1;
  bool executed = false;  ///< false: given up; never reported on finished_ptp
  Reason reason;          ///< why it was given up
};

/// The plug-in. Parameters: Table 5's `Kp` (1/s) and `max_queue`; and `default_speed`,
/// `default_acceleration` (shares of the robot's limits), `tolerance` (rad), `settle_time` (s),
/// `hold_blend` (s).
class PtpController : public MotionController {
 public:
  static constexpr int kMaxQueue = 64;  ///< largest max_queue

  /// add_ptp; any thread.
  PtpAnswer add(const PtpRequest& request);
  /// Motions that ended since the last call; one reader thread.
  bool readEnd(PtpEnd& end) { return ends_.pop(end); }

  // MotionController
  void configure(const MotionSetup& setup) override;
  void adopt(const CycleInput& input) override;
  void start(const CycleInput& input) override;
  void stop() override;
  void abort(const Reason& reason) override;
  void computeReference(const CycleInput& input, References& references) override;
  void resolve(const CycleInput& input, References& references) override;
  MotionState state() const override { return state_; }
  const Reason& reason() const override { return reason_; }

 private:
  struct Motion {
    int id = -1;
    JointVector target = JointVector::Zero();
    JointVector velocity = JointVector::Zero();
    JointVector acceleration = JointVector::Zero();
  };
  struct Plan {
    RequestStamp stamp;
    Motion motion;
    int status = PtpAnswer::kRejected;  ///< written by the cycle
    Reason refusal;                     ///< written by the cycle
  };

  void begin(const CycleInput& input, const Motion& motion);
  void finish(const CycleInput& input);
  void giveUp(const Reason& why);
  Answer readMotion(const PtpRequest& request, Motion& motion) const;

  MotionSetup setup_;
  double gain_ = 5.0, tolerance_ = 0.002, settle_time_ = 2.0;
  double default_speed_ = 0.3, default_acceleration_ = 0.2;
  int max_queue_ = 16;
  std::unique_ptr<TwoTaskIk>
      ik_;  // only for feedback controllers that move the tool while the arm holds
  PlanExchange<Plan> plans_;
  int next_id_ = 0;  // under the host's request lock

  // control thread
  MotionState state_ = MotionState::Idle;
  Reason reason_;
  std::array<Motion, kMaxQueue> queue_;
  int first_ = 0, queued_ = 0;
  Motion running_;
  bool pending_ = false;  ///< running_ was adopted and begins with the next joint state
  PtpTrajectory trajectory_;
  PtpPoint point_;
  double time_ = 0.0, settling_ = 0.0;
  StartBlend blend_;
  Hold hold_;
  IkResult ik_result_;
  EventRing<PtpEnd, 256> ends_;
};

}  // namespace coglab_controllers
