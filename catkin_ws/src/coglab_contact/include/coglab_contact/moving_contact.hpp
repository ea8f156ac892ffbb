/// @file
/// Contact from the torques of a moving arm: momentum observer, change of its residual, thresholds.
#pragma once

#include <memory>
#include <optional>

#include "coglab_contact/evidence.hpp"
#include "coglab_contact/motion_thresholds.hpp"

namespace coglab_contact {

/// Processes every sample of lwr/joint_states; gives evidence of contact. The default payload is
/// zero. feed() allocates only what the model of the arm allocates.
class MovingContact {
 public:
  /// @param period  see MomentumObserver.
  MovingContact(std::shared_ptr<ArmModel> model, JacobianAt jacobian, double period = 0.0);

  /// Uses these thresholds, and the lag of the torques that was learnt with them.
  void use(const MotionThresholds& thresholds);

  /// Sets a payload of `mass` kg at `centre` (m, palm). The past is deleted, so that the arrival of
  /// the load is no contact.
  /// @throws std::invalid_argument for an invalid mass.
  void setPayload(double mass, const Vector3& centre);

  /// Processes one measured sample: s, rad, Nm. `made`: see MomentumObserver::feed.
  void feed(double stamp, const Joints& position, const Joints& torque,
            std::optional<double> made = std::nullopt);

  /// Evidence of the newest samples. None without a reference mean, or if the last sample was left
  /// out.
  std::optional<Evidence> evidence() const;
  /// Evidence from the offset: an early touch leaves one before the detector was armed.
  std::optional<Evidence> steady() const;

  /// True if the arm has stood still for 0.25 s.
  bool still() const { return rest_.has_value(); }
  /// True if the arm moves so slowly that errors of the model's inertia do not matter.
  bool slow() const;

  /// Recent mean residual minus that of the last rest before the motion; none without such a rest.
  std::optional<Offset> offset() const;
  /// Residual of this rest minus that of the rest before the motion; none while the arm moves.
  std::optional<Offset> offsetOfMotion() const;
  /// Mean residual (Nm) of the last rest before the present or last motion, or of this rest if the
  /// arm has not moved yet; none without such a rest.
  std::optional<Joints> beforeMotion() const { return free_ ? free_ : rest_; }

  /// Weight (N) on the palm for a residual (Nm) at a position (rad): the downward part of the force
  /// that explains it best. A sideways pull is no weight.
  double weight(const Joints& residual, const Joints& position) const;
  /// Weight (N) on the palm at the last rest before the present or last motion; none if unknown.
  std::optional<double> weightBeforeMotion() const { return free_weight_; }
  /// Force (N) on the palm, base frame, against the residual `before` (Nm), 0.03 s ahead. None
  /// before the first measurement.
  std::optional<Vector3> forceSince(const Joints& before) const;

  double load() const { return load_; }                                  ///< kg
  const std::optional<Residual>& residual() const { return residual_; }  ///< newest
  const std::optional<Change>& change() const { return change_; }        ///< newest
  MomentumObserver& observer() { return observer_; }

 private:
  struct Moment {
    double stamp = 0.0;
    Joints torque = Joints::Zero();
  };

  void forget();
  void followRest(const Residual& residual);

  MomentumObserver observer_;
  JacobianAt jacobian_;
  MotionThresholds thresholds_;
  ChangeOfResidual changes_;
  double load_ = 0.0;
  std::optional<Residual> residual_;
  std::optional<Change> change_, last_change_;  // the last one before `change_`, where there is one
  std::optional<double> still_since_;
  std::optional<Joints> rest_,
      free_;  // mean residual of this rest, and of the one before the motion
  Joints rest_position_ = Joints::Zero();
  double rest_stamp_ = 0.0;
  std::optional<double> free_weight_;
  Ring<Moment> growing_;  // residuals of the last 0.02 s
};

}  // namespace coglab_contact
