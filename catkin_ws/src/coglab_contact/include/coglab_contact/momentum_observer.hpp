/// @file
/// External joint torques of a moving arm without accelerations: a momentum observer (De Luca,
/// Albu-Schaeffer, Haddadin, Hirzinger 2006).
///
///     r = K (p - integral of (tau + C^T q' - g + r)),   p = M(q) q'
///
/// so that r follows the external torque as a first-order low-pass with time constant 1/K. M, C and
/// g come from the robot description with the set payload. tau is the torque measured between
/// motors and links: friction of the drives and inertia of the motors do not enter. Velocities are
/// computed from positions only: the mean velocity between two samples belongs to the middle
/// between them. The torque of a sample counts as the mean over the period that ends with it, or
/// over an earlier one if torques lag behind positions.
#pragma once

#include <memory>
#include <optional>

#include "coglab_contact/types.hpp"

namespace coglab_contact {

/// Rigid-body terms at one posture and velocity.
struct ArmTerms {
  Joints momentum = Joints::Zero();    ///< M q', kg m^2/s
  Joints transposed = Joints::Zero();  ///< C^T q', Nm
  Joints gravity = Joints::Zero();     ///< g, Nm
};

/// Model of the arm; coglab_controllers::ArmDynamics is the one of the product.
class ArmModel {
 public:
  virtual ~ArmModel() = default;
  /// The terms at `q` (rad) and `velocity` (rad/s).
  virtual ArmTerms at(const Joints& q, const Joints& velocity) = 0;
  /// Sets a point mass of `mass` kg at `centre` (m, frame of the palm).
  virtual void setPayload(double mass, const Vector3& centre) = 0;
};

/// Result of the observer for one sample. Nm, rad, rad/s, rad/s^2.
struct Residual {
  double stamp = 0.0;                    ///< s
  Joints torque = Joints::Zero();        ///< estimate of the external torque
  Joints position = Joints::Zero();      ///< as measured
  Joints velocity = Joints::Zero();      ///< mean since the last sample
  Joints acceleration = Joints::Zero();  ///< low-passed like the estimate
  /// Derivative of the measured torque, Nm/s, low-passed too. A lag of 1 s more subtracts it.
  Joints rate = Joints::Zero();
  bool fresh = false;  ///< the observer has restarted: earlier estimates do not count
};

/// Processes consecutive samples. A sample that is not finite is left out. After a long gap or a
/// set clock a new estimate starts at zero: the torque that acts then counts as the arm's own.
/// feed() allocates only what the model allocates.
class MomentumObserver {
 public:
  /// @param gain    K, 1/s.
  /// @param period  of the robot's measurements, s; the time between samples is a multiple of it.
  ///                0: the stamps are exact. Jitter up to a quarter of a period is removed.
  /// @throws std::invalid_argument unless the gain is finite and positive.
  explicit MomentumObserver(std::shared_ptr<ArmModel> model, double gain = 40.0,
                            double period = 0.0);

  /// Deletes all past samples.
  void reset() { past_ = Past(); }

  /// Sets the payload: its weight and inertia are then no external torque. The estimate restarts.
  /// @throws std::invalid_argument for an invalid mass.
  void setPayload(double mass, const Vector3& centre);

  /// Processes one sample: s, rad, Nm. None until enough consecutive samples have arrived.
  /// @param made  the robot's own time (s) of the measurement, if known; then the stamp, which is
  ///              late on a busy computer, is not used.
  std::optional<Residual> feed(double stamp, const Joints& position, const Joints& torque,
                               std::optional<double> made = std::nullopt);

  double gain = 40.0;   ///< K, 1/s
  double period = 0.0;  ///< s, see the constructor
  double lag = 0.0;     ///< s by which the torques lag behind the positions of the same sample

 private:
  /// State after the last sample.
  struct Past {
    std::optional<double> stamp, made;
    double grid = 0.0, step = 0.0;
    Joints position = Joints::Zero(), torque = Joints::Zero();
    Joints velocity = Joints::Zero(), momentum = Joints::Zero(), forces = Joints::Zero();
    Joints residual = Joints::Zero(), acceleration = Joints::Zero(), rate = Joints::Zero();
    bool has_velocity = false, has_residual = false;
    int doubts = 0;
  };

  std::optional<double> sinceLast(double stamp, std::optional<double> made);
  std::optional<Residual> advance(double stamp, double step, const Joints& before,
                                  const Joints& torque_before);

  std::shared_ptr<ArmModel> model_;
  Past past_;
};

}  // namespace coglab_contact
