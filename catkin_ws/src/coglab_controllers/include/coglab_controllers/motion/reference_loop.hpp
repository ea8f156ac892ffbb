/// @file
/// Computes joint velocities from the reference of a motion: one control law for joints, one for
/// poses, and standstill between motions.
#pragma once

#include <memory>

#include "coglab_controllers/ik/two_task_ik.hpp"
#include "coglab_controllers/manager/motion_controller.hpp"
#include "coglab_controllers/manager/tunables.hpp"
#include "coglab_controllers/motion/hold.hpp"
#include "coglab_controllers/motion/motion.hpp"

namespace coglab_controllers {

/// Checks whether the measured arm arrives at the end of its reference.
class Arrival {
 public:
  enum class State : std::uint8_t {
    Waiting,
    There,
    Stuck  ///< not there after settle_time
  };

  /// Reads `settle_time` (s, default 2).
  void configure(const Parameters& parameters) {
    settle_time_ = parameters.number("settle_time", 2.0, 0.0, 60.0);
  }
  void begin() noexcept { waited_ = 0.0; }
  /// @param error distance of the arm from the end of the reference, m or rad
  /// @param allowed largest error that counts as There, same unit
  State update(double dt, double error, double allowed) noexcept {
    if (error <= allowed) return State::There;
    waited_ += dt;
    return waited_ > settle_time_ ? State::Stuck : State::Waiting;
  }
  /// Reason for a hand that is stuck.  @param away distance to the goal, m
  static Reason handStuck(double away) noexcept;

 private:
  double settle_time_ = 2.0, waited_ = 0.0;
};

/// Writes the reference, which feedback controllers may modify, and computes joint velocities from
/// the result. When a motion begins, the difference between set-point and measurement is blended
/// in. Only configure() allocates or throws.
///
/// Parameters: `Kp` (1/s, joints), `pos_clik_gain`, `rot_clik_gain` (1/s),
/// `correction_speed` (m/s), `singularity_threshold`, `rotation_first_scaling`,
/// `second_task` (orientation, axis, posture or none), `axis` (3, frame of the hand), `posture` (7,
/// rad), `posture_gain` (1/s) (poses, eq. 6-12), `hold_blend` (s), `tolerance` (rad),
/// `arrive_distance` (m). The first four are tunable.
class ReferenceLoop {
 public:
  /// What the references of a controller may be; the gains of the others are not offered.
  enum class Spaces : std::uint8_t { Both, Joint, Pose };

  /// @param tunables gets the gains that may change at run time; outlives this object
  /// @throws std::runtime_error naming the parameter
  void configure(const MotionSetup& setup, Spaces spaces, Tunables& tunables);

  /// Begins to control the arm, which brakes and stands.
  void begin() noexcept;
  /// Ends the motion: the arm brakes and stands.
  void open() noexcept;

  /// Writes the reference of this cycle.
  void write(const CycleInput& input, const MotionReference& reference,
             References& references) noexcept;
  /// Computes joint velocities from the references, which feedback controllers may have modified.
  void resolve(const CycleInput& input, References& references) noexcept;

  /// Set-point at which a motion begins: the last reference of the previous motion, else the
  /// commanded state.
  /// @param at_rest true: the previous motion has ended, so the velocities are zero
  SetPoint setPoint(const CycleInput& input, bool at_rest) const noexcept;

  /// Distance of the arm from the end of the last reference, and the largest one that counts as
  /// arrived; rad or m.
  double error(const CycleInput& input) const noexcept;
  double allowedError() const noexcept;
  /// Reason for an arm that does not arrive.
  Reason stuck(const CycleInput& input) const noexcept;

  const IkResult& ik() const noexcept { return ik_result_; }  ///< of the last cycle

 private:
  void configureSecondTask(const Parameters& parameters, double largest_gain);
  void takeGains(double dt) noexcept;
  void beginBlend(const CycleInput& input) noexcept;
  void resolveJoints(const CycleInput& input, References& references) noexcept;
  void resolvePose(const CycleInput& input, References& references) noexcept;

  std::shared_ptr<const RobotSetup> robot_;
  std::unique_ptr<TwoTaskIk> ik_;
  std::unique_ptr<SecondTask> second_task_;  // none: the orientation
  // null where the controller has no such references
  Tunable *joint_gain_ = nullptr, *position_gain_ = nullptr, *rotation_gain_ = nullptr,
          *correction_speed_ = nullptr;
  double gain_ = 5.0, tolerance_ = 0.002, arrive_distance_ = 0.01;
  MotionReference reference_;                                               // the last one written
  Eigen::Matrix<double, 7, 1> pose_ = Eigen::Matrix<double, 7, 1>::Zero();  // as written
  PoseCorrection correction_;  // by feedback controllers, in the last cycle
  StartBlend blend_;
  Hold hold_;
  bool resting_ = false;  // input.resting of the last cycle
  IkResult ik_result_;
};

}  // namespace coglab_controllers
