#include "coglab_controllers/dmp/dmp_request.hpp"

#include <stdexcept>

#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {
namespace {

constexpr double kSlowestArrival = 0.02;  // m/s
constexpr double kLongestApproach = 0.3;  // m

Answer checkOrientation(const Eigen::Vector4d& q) {
  if (!q.allFinite())
    return Answer::invalid("target_orientation holds a number that is not finite");
  if (q.isZero(0.0) || isUnit(Quaternion(q[3], q[0], q[1], q[2]))) return {};
  return Answer::invalid(
      "target_orientation has norm " + std::to_string(q.norm()) +
      "; expected a unit quaternion x y z w, or all zero to keep the present orientation");
}

}  // namespace

Answer check(const DmpRequest& request, bool execute) {
  try {
    requireRatio(request.dmp_ratio);
  } catch (const std::invalid_argument& error) {
    return Answer::refusal(ReasonCode::OutOfRange, error.what());
  }
  if (!request.goal_offset.allFinite()) {
    return Answer::invalid("goal_offset holds a number that is not finite");
  }
  if (!request.goal_approach.allFinite() || request.goal_approach.norm() > kLongestApproach) {
    return Answer::invalid("goal_approach is " + std::to_string(request.goal_approach.norm()) +
                           " m long; expected finite numbers and at most 0.3 m");
  }
  if (request.arrival_speed != 0.0 &&
      !(request.arrival_speed >= kSlowestArrival && request.arrival_speed <= kFastestArrival)) {
    return Answer::invalid("arrival_speed is " + std::to_string(request.arrival_speed) +
                           " m/s; expected 0 (as the primitive has it) or 0.02 to 0.45 m/s");
  }
  const char* wrong = request.goal_limits.wrong();
  if (*wrong != '\0') return Answer::invalid(wrong);
  if (request.orientation_control) {
    const Answer orientation = checkOrientation(request.target_orientation);
    if (!orientation.success) return orientation;
  }
  if (!execute) return {};
  if (request.initial_state != DmpRequest::kCurrent &&
      request.initial_state != DmpRequest::kGiven) {
    return Answer::invalid("initial_state " + std::to_string(request.initial_state) +
                           " is unknown; expected CURRENT=0 or GIVEN=1");
  }
  if (request.initial_state == DmpRequest::kGiven &&
      !(request.initial_position.allFinite() && request.initial_velocity.allFinite())) {
    return Answer::invalid(
        "initial_position or initial_velocity holds a number that is not finite");
  }
  return {};
}

Pose DmpPlan::handAt(const GoalObservation& seen) const noexcept {
  if (!in_goal_frame) return {seen.position + offset, orientation};
  Pose pose;
  pose.position = seen.position + seen.orientation * offset;
  pose.orientation = keep_orientation ? orientation : (seen.orientation * orientation).normalized();
  return pose;
}

}  // namespace coglab_controllers
