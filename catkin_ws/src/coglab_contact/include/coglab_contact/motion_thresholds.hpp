/// @file
/// Size of the momentum observer's residual without contact, as the robot has learnt it.
///
/// The detector uses the change of the residual against its own recent mean, so that sensor
/// offsets, a wrong payload and other slow errors of the model cancel. The variance of that change,
/// per joint, is a sum of shares that grow with speed, acceleration and the torque of the set
/// payload. motion_thresholds.py learns the shares. A change is explained by a force on the palm by
/// generalised least squares (Aitken 1935).
#pragma once

#include <optional>

#include "coglab_contact/momentum_observer.hpp"
#include "coglab_contact/ring.hpp"
#include "coglab_contact/types.hpp"

namespace coglab_contact {

/// Number of terms of the variance.
constexpr int kFeatures = 6;
/// Nm^2, lower limit of the variance: in a noise-free simulation, rounding must not trigger.
constexpr double kVarianceFloor = 1e-4;
/// Terms of the variance (Nm^2), one row per joint: 1; v (rad/s, fastest joint, averaged over the
/// memory of the residual); v^2; v^2 in the time of the reference mean; a^2 (rad/s^2, joint with
/// the largest acceleration); square of the change (Nm) of the torque that carries and accelerates
/// the payload.
using Features = Eigen::Matrix<double, 7, kFeatures>;

/// Change of the residual at one sample.
struct Change {
  double stamp = 0.0;                            ///< s
  Joints torque = Joints::Zero();                ///< Nm
  Features features = Features::Zero();          ///< terms of its variance
  Joints rate = Joints::Zero();                  ///< Nm/s, its derivative with respect to the lag
  Joints position = Joints::Zero();              ///< rad
  PalmJacobian jacobian = PalmJacobian::Zero();  ///< at this position
};

/// Residual at rest after a motion minus that before it, Nm, with the palm's Jacobian there.
struct Offset {
  Joints torque = Joints::Zero();
  PalmJacobian jacobian = PalmJacobian::Zero();
};

/// A force on the palm (N, base frame) and its length in standard deviations.
struct PalmForce {
  Vector3 force = Vector3::Zero();
  double size = 0.0;
};

/// The force on the palm that explains joint torques (Nm) with these standard deviations (Nm).
PalmForce explained(const Joints& torque, const Joints& deviation, const PalmJacobian& jacobian);

/// The force (N, base frame) on the palm that explains joint torques (Nm) best. Directions whose
/// effect on the joints is below a twentieth of the largest are ignored.
Vector3 forceOnPalm(const PalmJacobian& jacobian, const Joints& torque);

/// Learnt values; see coglab_contact.motion_thresholds.Thresholds.
struct MotionThresholds {
  Features variance = Features::Zero();  ///< shares of the variance of a change
  double limit = 1.0;                    ///< of the force of a change, standard deviations
  Joints steady = Joints::Ones();        ///< Nm, standard deviation of an offset
  double steady_limit = 1.0;             ///< of the force of an offset, standard deviations
  double lag = 0.0;                      ///< s, see MomentumObserver::lag

  /// Standard deviation (Nm) of each joint's change without contact.
  Joints deviation(const Features& features) const;
  /// The force that explains a change.
  PalmForce force(const Change& change) const;
  /// The same for an offset, seen while the arm moves with these features.
  PalmForce steadyForce(const Offset& offset, const Features& features) const;
};

/// Change of the residual against its own recent mean.
class ChangeOfResidual {
 public:
  /// Deletes the past.
  void reset();

  /// Processes one residual with the payload `load` (kg) and the palm's Jacobian there. None until
  /// there is a reference mean.
  std::optional<Change> feed(const Residual& residual, double load, const PalmJacobian& jacobian);

  /// Nm, mean of the samples between 0.1 and 0.25 s ago: fewer samples than for the change.
  Joints past() const;

 private:
  /// Residual, its rate, payload torque (7 each) and squared speed share one running sum.
  using Row = Eigen::Matrix<double, 22, 1>;
  struct Sample {
    double stamp = 0.0;
    Row row = Row::Zero();
  };

  void carry(const Residual& residual, double load, double step, double blend,
             const PalmJacobian& jacobian);

  Ring<Sample> recent_{64}, old_{256};
  Row sum_ = Row::Zero();
  std::optional<double> speed_;  // (rad/s)^2
  double stamp_ = 0.0;
  std::optional<Vector3> palm_;  // m/s
  Joints carried_ = Joints::Zero();
};

}  // namespace coglab_contact
