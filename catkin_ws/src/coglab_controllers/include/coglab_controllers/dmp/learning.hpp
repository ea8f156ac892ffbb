/// @file
/// Learning a primitive from demonstrations by regularised least squares. Not for the control
/// cycle.
#pragma once

#include <string>
#include <vector>

#include "coglab_controllers/dmp/primitive.hpp"

namespace coglab_controllers {

/// Options of learn(). The defaults suit reaches of about 1 s.
struct LearningOptions {
  int basis_count = 20;  ///< N, 2..kMaxBasis
  double alpha = CanonicalSystem::kDefaultAlpha;
  double stiffness = 150.0;  ///< K; D is 2 sqrt(K)
  GoalWeight goal_weight;
  ShapeMapping mapping = ShapeMapping::None;
  double regularisation = 1e-6;  ///< ridge, relative to the mean diagonal of the normal matrix
  /// Names of faults (DemonstrationLimits) that are accepted in a demonstration.
  std::vector<std::string> allow;
};

/// Limits for the demonstration of one reach. The quoted names are those of LearningOptions::allow.
/// The last two are checked only with 20 samples or more.
struct DemonstrationLimits {
  static constexpr double kShort = 0.05;     ///< "short": m, smallest way from the start
  static constexpr double kBrief = 0.25;     ///< "brief": s, smallest duration
  static constexpr double kJump = 5.0;       ///< "jump": m/s, largest speed between samples
  static constexpr double kJumpShare = 6.0;  ///< "jump": largest ratio of a step to its neighbours,
                                             ///< if the step is also over 20 % of the way
  static constexpr double kMoving = 0.5;     ///< "moving": largest speed at both ends, share of the
                                             ///< mean speed: a reach begins and ends at rest
  static constexpr double kNoisy = 0.02;     ///< "noisy": largest noise, share of the way
};

/// Learns a primitive from one or several demonstrations of one motion. They may differ in
/// duration, start and goal.
///
/// Eq. (1) is linear in the weights, so the reproduced *position* is linear in them too. The
/// weights minimise the squared distance between demonstrated and reproduced path, in units of each
/// path's length. So learning needs no second derivative of a noisy recording. The start velocity
/// of the demonstration is kept.
/// @throws std::invalid_argument for invalid demonstrations or options; the message names which and
/// why. A demonstration outside of DemonstrationLimits is refused unless `options.allow` names the
/// fault.
Primitive learn(const std::string& id, const std::vector<Trajectory>& demonstrations,
                const LearningOptions& options = {});

/// Runs a primitive from its own start to its own goal and samples it at the given times (s). For
/// tests and figures.
/// @param dt integration step, s.
Eigen::Matrix3Xd reproduce(const Primitive& primitive, const std::vector<double>& times,
                           double dt = 0.001);

}  // namespace coglab_controllers
