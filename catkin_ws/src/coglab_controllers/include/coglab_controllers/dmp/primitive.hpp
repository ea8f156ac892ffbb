/// @file
/// A motion primitive: it is learnt, stored in a library and selected by its id. Not for the
/// control cycle.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// The clock of a motion, eq. (3): tau * s' = -alpha * s. The phase s falls from 1 at the start of
/// a motion towards 0. The solution is exact, so the step size does not matter.
class CanonicalSystem {
 public:
  /// ln(100): the phase is 0.01 at the end of the demonstrated duration.
  static constexpr double kDefaultAlpha = 4.605170185988091;

  /// @param alpha rate, dimensionless.  @throws std::invalid_argument unless 0 < alpha <= 50.
  explicit CanonicalSystem(double alpha = kDefaultAlpha);

  double alpha() const noexcept { return alpha_; }
  /// Phase after `dt` seconds at time constant `tau` (s).
  double advance(double s, double dt, double tau) const noexcept;
  /// Time after the start, s, at which the phase is `s` (> 0).
  double timeAt(double s, double tau) const noexcept;

 private:
  double alpha_;
};

/// Largest number of basis functions of a primitive; the control cycle holds them in fixed-size
/// arrays.
constexpr int kMaxBasis = 64;

/// The weight w(s) of eq. (1): 0 at the start of a motion, 1 at its end.
struct GoalWeight {
  enum class Kind {
    Linear,  ///< w = 1 - s: the Hoffmann/Pastor 2009 law
    Sigmoid  ///< logistic in s around `centre`, scaled so that w(1) = 0 and w(0) = 1
  };
  Kind kind = Kind::Linear;
  double centre = 0.5;      ///< phase at which a sigmoid is steepest, 0..1
  double steepness = 10.0;  ///< of a sigmoid, 1..100

  double operator()(double s) const noexcept;
};

/// How the learnt shape adapts to a start and goal other than the demonstrated ones.
enum class ShapeMapping {
  None,        ///< eq. (5) as learnt, for any goal
  Similarity,  ///< turned (smallest rotation) and scaled, from the demonstrated line (start to
               ///< goal) to the present one
  Upright      ///< turned about the vertical and scaled, so that upward stays upward
};

/// m; a shorter line has no direction, and shapes are not scaled with it.
constexpr double kShortestLine = 1e-3;

/// Linear map of a shape that takes the line `demonstrated` (start to goal, m) to the present
/// `line`, unless one is shorter than kShortestLine. Eq. (1)-(5) are invariant under it.
Matrix3 shapeMap(ShapeMapping mapping, const Vector3& demonstrated, const Vector3& line) noexcept;

/// Name of a mapping in library files: none, similarity, upright.
const char* describe(ShapeMapping mapping) noexcept;
/// The mapping of a name. @throws std::invalid_argument if unknown; it lists the names.
ShapeMapping toShapeMapping(const std::string& word);

/// One demonstrated path: equal numbers of times and positions, at least 5, times strictly
/// increasing.
struct Trajectory {
  std::vector<double> times;   ///< s
  Eigen::Matrix3Xd positions;  ///< m, one column per time
};

/// A learnt primitive: all parameters of eq. (1)-(5). A plain value; `validate` checks it.
struct Primitive {
  std::string id;           ///< 1..64 letters, digits, '_', '-', '.'
  std::string description;  ///< free text for people, up to 500 characters
  double duration = 1.0;    ///< s, of the demonstration: the time constant at dmp_ratio 1
  double alpha = CanonicalSystem::kDefaultAlpha;
  double stiffness = 150.0;             ///< K, in units of 1/duration^2
  double damping = 24.494897427831781;  ///< D, in units of 1/duration; 2 sqrt(K) is critical
  GoalWeight goal_weight;
  ShapeMapping mapping = ShapeMapping::None;
  Vector3 start = Vector3::Zero();           ///< m, of the demonstration
  Vector3 goal = Vector3::Zero();            ///< m, of the demonstration
  Vector3 start_velocity = Vector3::Zero();  ///< m/s, of the demonstration
  Eigen::VectorXd centres;                   ///< c_i, in phase
  Eigen::VectorXd widths;                    ///< h_i, 1/phase^2
  Eigen::Matrix3Xd weights;  ///< w_i, m, relative to the start; one column per basis function

  int basisCount() const noexcept { return static_cast<int>(centres.size()); }
};

/// @throws std::invalid_argument with the field, the expected and the received value.
void validate(const Primitive& primitive);

/// @throws std::invalid_argument with the sample or count, the expected and the received value.
void validate(const Trajectory& trajectory);

/// Sets centres that are equally spaced in time over the duration, and widths at which neighbours
/// intersect at a fixed height.
void placeBasis(int count, double alpha, Eigen::VectorXd& centres, Eigen::VectorXd& widths);

}  // namespace coglab_controllers
