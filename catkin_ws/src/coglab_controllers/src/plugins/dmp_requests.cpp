// Requests of the DMP plug-in: checked here, outside the cycle, and turned into plans.
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "coglab_controllers/kinematics/rotation.hpp"
#include "coglab_controllers/plugins/dmp_plan.hpp"

namespace coglab_controllers {

namespace {

std::string text(const Vector3& v) {
  std::ostringstream out;
  out << "(" << v.x() << ", " << v.y() << ", " << v.z() << ") m";
  return out.str();
}

Answer invalid(std::string why) {
  return Answer::refusal(ReasonCode::InvalidArgument, std::move(why));
}

/// Refuses a target orientation that is none. Sets whether the hand keeps the one it has.
Answer readOrientation(const DmpRequest& request, HandGoal& hand) {
  const Eigen::Vector4d& q = request.target_orientation;
  hand.keep_orientation = true;
  if (!request.orientation_control) return {};
  if (!q.allFinite()) return invalid("target_orientation holds a number that is not finite");
  if (q.isZero(0.0)) return {};
  const Quaternion orientation(q[3], q[0], q[1], q[2]);
  if (!isUnit(orientation)) {
    std::ostringstream out;
    out << "target_orientation has norm " << q.norm()
        << "; expected a unit quaternion x y z w, or all zero to keep the present orientation";
    return invalid(out.str());
  }
  hand.orientation = orientation.normalized();
  hand.keep_orientation = false;
  return {};
}

/// What to add to a sentence about a goal whose newest frame was refused.
std::string aheadNote(double ahead) {
  if (ahead <= 0.0) return "";
  return "; its newest frame is stamped " + std::to_string(ahead) +
         " s ahead of this computer's clock and was refused: synchronise the clocks";
}

}  // namespace

void DmpController::setGoalSource(GoalSource* source) {
  const std::lock_guard<std::mutex> lock(goal_mutex_);
  source_ = source;
}

Answer DmpController::loadDmps(const std::string& filename, int& loaded) {
  loaded = 0;
  const std::lock_guard<std::mutex> lock(library_mutex_);
  try {
    loaded = library_.load(filename);
    return {};
  } catch (const std::exception& error) {
    return Answer::refusal(ReasonCode::BadFile, error.what());
  }
}

Answer DmpController::execute(const DmpRequest& request) { return this->request(request, true); }

Answer DmpController::switchDmp(const DmpRequest& request) { return this->request(request, false); }

Answer DmpController::checkRequest(const DmpRequest& request, bool execute, Plan& plan) const {
  try {
    const std::lock_guard<std::mutex> lock(library_mutex_);
    plan.motion.system = TransformationSystem(library_.at(request.primitive_id));
  } catch (const std::exception& error) {
    return Answer::refusal(ReasonCode::UnknownName, error.what());
  }
  plan.primitive << request.primitive_id.c_str();
  try {
    requireRatio(request.dmp_ratio);
  } catch (const std::exception& error) {
    return Answer::refusal(ReasonCode::OutOfRange, error.what());
  }
  plan.motion.ratio = request.dmp_ratio;
  plan.motion.orientation_control = request.orientation_control;
  if (!request.goal_offset.allFinite()) {
    return invalid("goal_offset holds a number that is not finite");
  }
  plan.hand.offset = request.goal_offset;
  plan.hand.in_goal_frame = !request.goal_frame.empty();
  const Answer orientation = readOrientation(request, plan.hand);
  if (!orientation.success || !execute) return orientation;

  if (request.initial_state != DmpRequest::kCurrent &&
      request.initial_state != DmpRequest::kGiven) {
    return invalid("initial_state " + std::to_string(request.initial_state) +
                   " is unknown; expected CURRENT=0 or GIVEN=1");
  }
  plan.given = request.initial_state == DmpRequest::kGiven;
  if (plan.given) {
    if (!request.initial_position.allFinite() || !request.initial_velocity.allFinite()) {
      return invalid("initial_position or initial_velocity holds a number that is not finite");
    }
    plan.initial_position = request.initial_position;
    plan.initial_velocity = request.initial_velocity;
  }
  return {};
}

Answer DmpController::findFrames(Plan& plan) {
  if (dmp_frame_ == base_frame_) return {};
  const std::lock_guard<std::mutex> lock(goal_mutex_);
  GoalObservation transform;
  std::string why = "nothing provides frames";
  if (source_ == nullptr || !source_->lookup(base_frame_, dmp_frame_, transform, why)) {
    return Answer::refusal(ReasonCode::UnknownName, "frame '" + dmp_frame_ +
                                                        "' (dmp_frame_name) is not known in '" +
                                                        base_frame_ + "': " + why);
  }
  plan.base_from_dmp = {transform.position, transform.orientation};
  return {};
}

Answer DmpController::findGoal(const std::string& frame, Plan& plan) {
  const std::lock_guard<std::mutex> lock(goal_mutex_);
  if (frame.empty()) return findTopicGoal(plan);
  std::string why;
  if (source_ == nullptr) {
    return Answer::refusal(ReasonCode::GoalMissing, "nothing provides frames");
  }
  GoalObservation goal;
  const bool known = source_->lookup(dmp_frame_, frame, goal, why);
  const double ahead = source_->ahead(frame);
  if (!known) {
    return Answer::refusal(ahead > 0.0 ? ReasonCode::GoalFromFuture : ReasonCode::UnknownName,
                           "goal frame '" + frame + "' is not known in '" + dmp_frame_ +
                               "': " + why + aheadNote(ahead));
  }
  if (!goal.position.allFinite() || !isUnit(goal.orientation)) {
    return invalid("goal frame '" + frame + "' has a pose that is not finite");
  }
  const double age = 1e-9 * static_cast<double>(setup_.host->now_ns() - goal.stamp_ns);
  if (age > frame_gate_.max_age) {
    return Answer::refusal(ReasonCode::GoalStale,
                           "goal frame '" + frame + "' is " + std::to_string(age) +
                               " s old, allowed: " + std::to_string(frame_gate_.max_age) +
                               " s (goal_max_age); check what publishes it" + aheadNote(ahead));
  }
  if (age < -1e-9 * static_cast<double>(kClockTolerance_ns)) {
    return Answer::refusal(ReasonCode::GoalFromFuture,
                           "goal frame '" + frame + "' is not followed" + aheadNote(-age));
  }
  goal.request = request_number_ + 1;  // in effect once the plan is
  plan.goal = goal;
  return {};
}

Answer DmpController::findTopicGoal(Plan& plan) {
  if (!topic_goal_known_) {
    return Answer::refusal(
        ReasonCode::GoalMissing,
        "no goal has come on dmp_goal yet; name the tf2 frame to follow in goal_frame, or "
        "publish a goal in frame '" +
            dmp_frame_ + "' first (goal_helper.launch does)");
  }
  plan.goal = topic_goal_;
  plan.goal.request = request_number_ + 1;
  return {};
}

void DmpController::followFrom(const std::string& frame, const GoalObservation& first) {
  const std::lock_guard<std::mutex> lock(goal_mutex_);
  request_number_ = first.request;
  frame_of_motion_ = frame;
  pushed_ = frame.empty() ? topic_goal_ : first;  // a dmp_goal may have come meanwhile
  pushed_.request = request_number_;
  ahead_ = 0.0;
  goals_.write(pushed_);
}

Answer DmpController::request(const DmpRequest& request, bool execute) {
  const MotionRequest begun = setup_.host->beginRequest(setup_.id);
  if (!begun.welcome.success) return begun.welcome;
  auto plan = std::make_unique<Plan>();
  plan->stamp = begun.stamp;
  plan->execute = execute;
  Answer checked = checkRequest(request, execute, *plan);
  if (checked.success) checked = findFrames(*plan);
  if (checked.success && execute) checked = findGoal(request.goal_frame, *plan);
  if (checked.success && execute) checked = outsideWorkspace(*plan);
  if (!checked.success) return checked;
  const GoalObservation goal = plan->goal;
  Answer answer = offer(std::move(plan));
  if (answer.success && execute) followFrom(request.goal_frame, goal);
  return answer;
}

Answer DmpController::outsideWorkspace(const Plan& plan) const {
  const Workspace& workspace = setup_.robot->workspace;
  const Pose& to_base = plan.base_from_dmp;
  const Vector3 in_dmp = handGoal(plan.goal, plan.hand).position;
  const Vector3 goal = to_base.position + to_base.orientation * in_dmp;
  const double outside = (workspace.project(goal) - goal).norm();
  const double margin = plan.hand.in_goal_frame ? reach_margin_ : 0.0;
  if (outside > margin + 1e-9) {
    return Answer::refusal(
        ReasonCode::GoalOutsideWorkspace,
        "the hand's goal " + text(goal) + " is " + std::to_string(outside) +
            " m outside the workspace (" + describe(workspace.violated(goal)) + "); box from " +
            text(workspace.parameters().box_min) + " to " + text(workspace.parameters().box_max) +
            ", " + std::to_string(workspace.parameters().base_radius) + " m from the base");
  }
  if (plan.given) {
    const Vector3 start = to_base.position + to_base.orientation * plan.initial_position;
    const RobotSample robot = setup_.host->robotSnapshot();
    const Vector3 hand = setup_.robot->chain.evaluate(robot.commanded_position).tool.position;
    const double distance = (start - hand).norm();
    if (distance > max_initial_distance_) {
      return Answer::refusal(
          ReasonCode::OutOfRange,
          "initial_position is " + std::to_string(distance) + " m from the hand at " + text(hand) +
              "; allowed: " + std::to_string(max_initial_distance_) +
              " m (max_initial_distance); use initial_state CURRENT");
    }
    if (plan.initial_velocity.norm() > 2.0) {
      return Answer::refusal(ReasonCode::OutOfRange,
                             "initial_velocity is " +
                                 std::to_string(plan.initial_velocity.norm()) +
                                 " m/s; expected at most 2 m/s");
    }
  }
  return {};
}

Answer DmpController::offer(std::unique_ptr<Plan> plan) {
  Answer answer;
  const PlanOutcome outcome =
      plans_->offer(std::move(plan), setup_.host->planTimeout(), [&answer](const Plan& adopted) {
        if (!adopted.refusal.empty()) answer = Answer::refusal(adopted.refusal);
      });
  if (outcome == PlanOutcome::Withdrawn) {
    return Answer::refusal(ReasonCode::NotAdopted, setup_.host->notAdopted(outcome));
  }
  if (outcome == PlanOutcome::Taken) answer.message = setup_.host->notAdopted(outcome);
  return answer;
}

Answer DmpController::setGoal(const std::string& frame, const Vector3& goal,
                              std::int64_t stamp_ns, std::int64_t frame_ns) {
  if (frame != dmp_frame_) {
    return Answer::refusal(ReasonCode::UnknownName,
                           "dmp_goal in frame '" + frame + "' refused: expected '" + dmp_frame_ +
                           "' (dmp_frame_name); the goal helper transforms goals");
  }
  if (!goal.allFinite()) {
    return invalid("dmp_goal refused: it holds a number that is not finite");
  }
  const std::lock_guard<std::mutex> lock(goal_mutex_);
  const bool followed = frame_of_motion_.empty();
  const std::int64_t now = setup_.host->now_ns();
  GoalObservation observation;
  observation.position = goal;
  observation.stamp_ns = stamp_ns != 0 ? stamp_ns : now;
  observation.frame_ns = frame_ns != 0 ? frame_ns : observation.stamp_ns;
  observation.request = request_number_;
  if (observation.stamp_ns - now > kClockTolerance_ns) {
    const double ahead = 1e-9 * static_cast<double>(observation.stamp_ns - now);
    if (followed) ahead_ = ahead;
    return Answer::refusal(ReasonCode::GoalFromFuture, "dmp_goal refused" + aheadNote(ahead));
  }
  if (topic_goal_known_ && observation.frame_ns <= topic_goal_.frame_ns) {
    return Answer::refusal(ReasonCode::TooLate,
                           "dmp_goal refused: its stamp is not newer than that of the last one");
  }
  topic_goal_known_ = true;
  topic_goal_ = observation;
  Answer answer;
  if (followed) {
    ahead_ = 0.0;
    goals_.write(observation);
  } else {
    answer.message = "dmp_goal is kept for later: the last execute_dmp named the goal_frame '" +
                     frame_of_motion_ + "'; with an empty one a motion follows dmp_goal";
  }
  return answer;
}

void DmpController::pollGoal() {
  const std::lock_guard<std::mutex> lock(goal_mutex_);
  if (source_ == nullptr || frame_of_motion_.empty()) return;
  GoalObservation goal;
  std::string why;
  ahead_ = source_->ahead(frame_of_motion_);
  if (!source_->lookup(dmp_frame_, frame_of_motion_, goal, why)) return;
  if (!goal.position.allFinite() || !isUnit(goal.orientation)) return;
  const std::int64_t ahead = goal.stamp_ns - setup_.host->now_ns();
  if (ahead > kClockTolerance_ns) {
    ahead_ = 1e-9 * static_cast<double>(ahead);
    return;
  }
  // Told apart by their own stamps: what those map to differs from one poll to the next.
  if (goal.frame_ns != 0 && goal.frame_ns <= pushed_.frame_ns) return;
  goal.request = request_number_;
  pushed_ = goal;
  goals_.write(goal);
}

}  // namespace coglab_controllers
