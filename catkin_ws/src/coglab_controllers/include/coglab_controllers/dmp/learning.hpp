/// @file
/// Learning a primitive from demonstrations by regularised least squares. Not for the control
/// cycle.
#pragma once

#include <string>
#include <vector>

#include "coglab_controllers/dmp/primitive.hpp"

namespace coglab_controllers {

/// How to learn; the defaults suit reaches of about a second.
struct LearningOptions {
  int basis_count = 20;  ///< N, 2..kMaxBasis
  double alpha = CanonicalSystem::kDefaultAlpha;
  double stiffness = 150.0;  ///< K; D is 2 sqrt(K)
  GoalWeight goal_weight;
  ShapeMapping mapping = ShapeMapping::None;
  double regularisation = 1e-6;  ///< ridge, relative to the mean diagonal of the normal matrix
  /// Faults of a demonstration (DemonstrationLimits) that are not refused.
  std::vector<std::string> allow;
};

/// What a demonstration of one reach must be like; the names are those of LearningOptions::allow.
/// The last two are judged from 20 samples on.
struct DemonstrationLimits {
  static constexpr double kShort = 0.05;     ///< "short": m, goes at least so far from its start
  static constexpr double kBrief = 0.25;     ///< "brief": s, takes at least so long
  static constexpr double kJump = 5.0;       ///< "jump": m/s between two samples, or one step so
  static constexpr double kJumpShare = 6.0;  ///< many times as long as those around it
  static constexpr double kMoving = 0.5;     ///< "moving": largest speed at both ends, share of the
                                             ///< mean speed: a reach begins and ends at rest
  static constexpr double kNoisy = 0.02;     ///< "noisy": largest noise, share of the way it goes
};

/// Learns from one or several demonstrations of one motion, which may differ in duration, start and
/// goal.
///
/// Eq. (1) is linear in the weights, so the *position* that the system runs through is linear in
/// them too: the weights minimise the squared distance between demonstrated and reproduced path (in
/// units of each path's length) and never need the second derivative of a noisy recording. The
/// start velocity of the demonstration is kept.
/// @throws std::invalid_argument for invalid demonstrations or options, saying which and why.
/// Demonstrations outside of DemonstrationLimits are refused unless `options.allow` names the
/// fault.
Primitive learn(const std::string& id, const std::vector<Trajectory>& demonstrations,
                const LearningOptions& options = {});

/// Runs a primitive from its own start to its own goal and samples it at the given times (s). For
/// tests and figures.
/// @param dt integration step, s.
Eigen::Matrix3Xd reproduce(const Primitive& primitive, const std::vector<double>& times,
                           double dt = 0.001);

}  // namespace coglab_controllers
