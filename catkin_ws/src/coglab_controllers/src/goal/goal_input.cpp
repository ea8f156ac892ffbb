#include "coglab_controllers/goal/goal_input.hpp"

#include <utility>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {

namespace {

/// Addition to a message about a goal whose newest frame was refused.
std::string aheadNote(double ahead) {
  if (ahead <= 0.0) return "";
  return "; its newest frame is stamped " + std::to_string(ahead) +
         " s ahead of this computer's clock and was refused: synchronise the clocks";
}

}  // namespace

GoalFrameLimits readGoalLimits(const Parameters& parameters) {
  GoalFrameLimits limits;
  limits.max_age = parameters.number("goal_max_age", limits.max_age, 0.01, 10.0);
  limits.max_jump = parameters.number("goal_max_jump", limits.max_jump, 0.01, 5.0);
  limits.lost_time = parameters.number("goal_lost_time", limits.lost_time, 0.0, 60.0);
  return limits;
}

void GoalInput::configure(const std::string& frame, const GoalFrameLimits& limits,
                          const MotionHost& host) {
  frame_ = frame;
  max_age_ = limits.max_age;
  host_ = &host;
}

void GoalInput::setSource(GoalSource* source) {
  const std::lock_guard<std::mutex> lock(mutex_);
  source_ = source;
}

Answer GoalInput::transform(const std::string& reference, const std::string& frame,
                            const char* what, Pose& pose) {
  const std::lock_guard<std::mutex> lock(mutex_);
  GoalObservation seen;
  std::string why = "nothing provides frames";
  if (source_ == nullptr || !source_->lookup(reference, frame, seen, why)) {
    return Answer::refusal(
        ReasonCode::UnknownName,
        "frame '" + frame + "' (" + what + ") is not known in '" + reference + "': " + why);
  }
  pose = {seen.position, seen.orientation};
  return {};
}

Answer GoalInput::first(const std::string& frame, GoalObservation& goal) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (frame.empty()) return firstOfTopic(goal);
  std::string why;
  if (source_ == nullptr) {
    return Answer::refusal(ReasonCode::GoalMissing, "nothing provides frames");
  }
  const bool known = source_->lookup(frame_, frame, goal, why);
  const double ahead = source_->ahead(frame);
  if (!known) {
    return Answer::refusal(
        ahead > 0.0 ? ReasonCode::GoalFromFuture : ReasonCode::UnknownName,
        "goal frame '" + frame + "' is not known in '" + frame_ + "': " + why + aheadNote(ahead));
  }
  if (!goal.position.allFinite() || !isUnit(goal.orientation)) {
    return Answer::invalid("goal frame '" + frame + "' has a pose that is not finite");
  }
  const double age = 1e-9 * static_cast<double>(host_->now_ns() - goal.stamp_ns);
  if (age > max_age_) {
    return Answer::refusal(ReasonCode::GoalStale,
                           "goal frame '" + frame + "' is " + std::to_string(age) +
                               " s old, allowed: " + std::to_string(max_age_) +
                               " s (goal_max_age); check what publishes it" + aheadNote(ahead));
  }
  if (age < -1e-9 * static_cast<double>(kClockTolerance_ns)) {
    return Answer::refusal(ReasonCode::GoalFromFuture,
                           "goal frame '" + frame + "' is not followed" + aheadNote(-age));
  }
  goal.request = request_number_ + 1;  // in effect once the plan is
  return {};
}

Answer GoalInput::firstOfTopic(GoalObservation& goal) const {
  if (!topic_goal_known_) {
    return Answer::refusal(
        ReasonCode::GoalMissing,
        "no goal has come on dmp_goal yet; name the tf2 frame to follow in goal_frame, or "
        "publish a goal in frame '" +
            frame_ + "' first (goal_helper.launch does)");
  }
  goal = topic_goal_;
  goal.request = request_number_ + 1;
  return {};
}

void GoalInput::follow(const std::string& frame, const GoalObservation& first) {
  const std::lock_guard<std::mutex> lock(mutex_);
  request_number_ = first.request;
  owner_ = frame;
  polled_ = frame.empty() ? topic_goal_ : first;  // a dmp_goal may have arrived meanwhile
  polled_.request = request_number_;
  ahead_ = 0.0;
  newest_.write(polled_);
}

/// True if the stamp of the last goal is ahead of the clock of the present stamps. It was not ahead
/// when it arrived, so that clock was set back.
bool GoalInput::clockSteppedBack(const GoalObservation& newest, std::int64_t now) const {
  const std::int64_t later = topic_goal_.frame_ns - newest.frame_ns;
  return later + (newest.stamp_ns - now) > kClockTolerance_ns;
}

Answer GoalInput::offer(const std::string& frame, const Vector3& position, std::int64_t stamp_ns,
                        std::int64_t frame_ns) {
  if (frame != frame_) {
    return Answer::refusal(ReasonCode::UnknownName,
                           "dmp_goal in frame '" + frame + "' refused: expected '" + frame_ +
                               "' (dmp_frame_name); the goal helper transforms goals");
  }
  if (!position.allFinite()) {
    return Answer::invalid("dmp_goal refused: it holds a number that is not finite");
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool followed = owner_.empty();
  const std::int64_t now = host_->now_ns();
  GoalObservation goal;
  goal.position = position;
  goal.stamp_ns = stamp_ns != 0 ? stamp_ns : now;
  goal.frame_ns = frame_ns != 0 ? frame_ns : goal.stamp_ns;
  goal.clock_steps = topic_goal_.clock_steps;
  goal.request = request_number_;
  if (goal.stamp_ns - now > kClockTolerance_ns) {
    const double ahead = 1e-9 * static_cast<double>(goal.stamp_ns - now);
    if (followed) ahead_ = ahead;
    return Answer::refusal(ReasonCode::GoalFromFuture, "dmp_goal refused" + aheadNote(ahead));
  }
  if (topic_goal_known_ && clockSteppedBack(goal, now)) ++goal.clock_steps;
  if (topic_goal_known_ && !goal.isLaterThan(topic_goal_)) {
    return Answer::refusal(ReasonCode::TooLate,
                           "dmp_goal refused: its stamp is not newer than that of the last one");
  }
  topic_goal_known_ = true;
  topic_goal_ = goal;
  Answer answer;
  if (followed) {
    ahead_ = 0.0;
    newest_.write(goal);
  } else {
    answer.message = "dmp_goal is kept for later: the last execute_dmp named the goal_frame '" +
                     owner_ + "'; with an empty one a motion follows dmp_goal";
  }
  return answer;
}

void GoalInput::poll() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (source_ == nullptr || owner_.empty()) return;
  GoalObservation goal;
  std::string why;
  ahead_ = source_->ahead(owner_);
  if (!source_->lookup(frame_, owner_, goal, why)) return;
  if (!goal.position.allFinite() || !isUnit(goal.orientation)) return;
  const std::int64_t ahead = goal.stamp_ns - host_->now_ns();
  if (ahead > kClockTolerance_ns) {
    ahead_ = 1e-9 * static_cast<double>(ahead);
    return;
  }
  // Compare the received stamps, because their conversions differ from one poll to the next.
  if (goal.frame_ns != 0 && !goal.isLaterThan(polled_)) return;
  goal.request = request_number_;
  polled_ = goal;
  newest_.write(goal);
}

}  // namespace coglab_controllers
