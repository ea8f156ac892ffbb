/// @file
/// From the reference of a motion to joint velocities: one control law for joints, one for poses,
/// and standing still between motions.
#pragma once

#include <memory>

#include "coglab_controllers/ik/two_task_ik.hpp"
#include "coglab_controllers/manager/motion_controller.hpp"
#include "coglab_controllers/motion/hold.hpp"
#include "coglab_controllers/motion/motion.hpp"

namespace coglab_controllers {

/// Whether the arm, as measured, comes to where its reference has ended.
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
  /// @param error of the arm, m or rad  @param allowed for There
  State update(double dt, double error, double allowed) noexcept {
    if (error <= allowed) return State::There;
    waited_ += dt;
    return waited_ > settle_time_ ? State::Stuck : State::Waiting;
  }
  /// The reason of a hand that is stuck.  @param away m
  static Reason handStuck(double away) noexcept;

 private:
  double settle_time_ = 2.0, waited_ = 0.0;
};

/// Writes the reference that feedback controllers see, and turns what they leave of it into joint
/// velocities. Where a motion begins, the difference between set-point and measurement is blended
/// in. No allocation, no throw but in configure().
///
/// Parameters: `Kp` (1/s, joints), `pos_clik_gain`, `rot_clik_gain` (1/s),
/// `correction_speed` (m/s), `singularity_threshold`, `rotation_first_scaling` (poses, eq. 6-12),
/// `hold_blend` (s), `tolerance` (rad), `arrive_distance` (m).
class ReferenceLoop {
 public:
  /// @throws std::runtime_error naming the parameter
  void configure(const MotionSetup& setup);

  /// The motion has ended: the arm brakes and stands.
  void open() noexcept;

  /// Writes the reference of this cycle.
  void write(const CycleInput& input, const MotionReference& reference,
             References& references) noexcept;
  /// From the references, perhaps modified, to joint velocities.
  void resolve(const CycleInput& input, References& references) noexcept;

  /// Where a motion begins: on the reference of the one that it follows, else on the commanded
  /// state.
  /// @param at_rest the one before has come to its end
  SetPoint setPoint(const CycleInput& input, bool at_rest) const noexcept;

  /// How far the arm is from the end of the last reference, rad or m, and what counts as there.
  double error(const CycleInput& input) const noexcept;
  double allowedError() const noexcept;
  /// The reason of an arm that does not come there.
  Reason stuck(const CycleInput& input) const noexcept;

  const IkResult& ik() const noexcept { return ik_result_; }  ///< of the last cycle

 private:
  void beginBlend(const CycleInput& input) noexcept;
  void resolveJoints(const CycleInput& input, References& references) noexcept;
  void resolvePose(const CycleInput& input, References& references) noexcept;

  std::shared_ptr<const RobotSetup> robot_;
  std::unique_ptr<TwoTaskIk> ik_;
  double gain_ = 5.0, tolerance_ = 0.002, arrive_distance_ = 0.01;
  MotionReference reference_;  // the last one written
  StartBlend blend_;
  Hold hold_;
  IkResult ik_result_;
};

}  // namespace coglab_controllers
