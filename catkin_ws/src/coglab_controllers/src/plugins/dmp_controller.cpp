// Requests of the DMP plug-in: checked outside the cycle and converted to plans.
#include "coglab_controllers/plugins/dmp_controller.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {

namespace {

constexpr double kFastestStart = 2.0;  // m/s
constexpr double kOnBorder = 1e-3;     // m, largest distance of a path outside the workspace

std::string text(const Vector3& v) {
  std::ostringstream out;
  out << "(" << v.x() << ", " << v.y() << ", " << v.z() << ") m";
  return out.str();
}

RunnerPolicy dmpPolicy() {
  RunnerPolicy policy;
  policy.open_end = true;
  policy.id_name = nullptr;
  policy.longest_queue = 0;
  policy.spaces = ReferenceLoop::Spaces::Pose;
  return policy;
}

bool endsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

DmpController::DmpController()
    : MotionRunner<DmpPlan>(std::make_unique<DmpCycle>(goals_), dmpPolicy()),
      cycle_(static_cast<DmpCycle*>(&inner())),
      imagined_(goals_) {}

void DmpController::configure(const MotionSetup& setup) {
  const Parameters parameters(setup.parameters, setup.id);
  base_frame_ = parameters.text("robot_base_frame_name", setup.robot->chain.baseLink());
  dmp_frame_ = parameters.text("dmp_frame_name", base_frame_);
  goal_tf_frame_ = parameters.text("goal_tf_frame", "dmp_goal");
  setIkDebug(parameters.flag("enable_ik_debug", false));
  predicted_ = parameters.text("predicted_goals", "");
  reach_margin_ = parameters.number("goal_reach_margin", 0.5, 0.0, 5.0);
  max_initial_distance_ = parameters.number("max_initial_distance", 0.1, 0.0, 1.0);
  max_scale_ = parameters.number("max_scale", max_scale_, 1.0, 1000.0);
  arrive_distance_ = parameters.number("arrive_distance", arrive_distance_, 1e-4, 0.5);
  goals_.configure(dmp_frame_, readGoalLimits(parameters), *setup.host);
  MotionRunner<DmpPlan>::configure(setup);
  MotionConfiguration configuration(setup, not_offered_);
  imagined_.configure(configuration);
  const std::string file = parameters.text("dmp_file", "");
  if (file.empty()) return;
  int loaded = 0;
  const Answer answer = loadDmps(file, loaded);
  if (!answer.success) throw std::runtime_error(answer.message);
}

// ---- the control thread
// --------------------------------------------------------------------------

Reason DmpController::unwelcome(const DmpPlan& plan) const {
  if (plan.execute) return {};
  if (stage() == RunnerStage::Moving)
    return scaledTooFar(plan, motion().dmp().startPosition(), motion().goal());
  if (stage() == RunnerStage::Rest) {
    return Reason(ReasonCode::NothingRuns, "no motion is running; use execute_dmp");
  }
  return Reason(ReasonCode::Busy, "a motion is about to begin; ask again when it runs");
}

void DmpController::report(std::int64_t stamp_ns) {
  progress_.write(cycle_->progress(stamp_ns, state(), reason()));
  if (stage() == RunnerStage::Moving) {
    snapshots_.give([&] { return cycle_->snapshot(stamp_ns); });
  }
}

void DmpController::resolve(const CycleInput& input, References& references) {
  MotionRunner<DmpPlan>::resolve(input, references);
  if (ikDebug() && cycle_->loopClosed()) debug_.push(cycle_->debug(input, loop().ik()));
}

// ---- requests
// ------------------------------------------------------------------------------------

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

Answer DmpController::ask(const DmpRequest& request, bool execute) {
  const MotionRequest begun = setup().host->beginRequest(id());
  if (!begun.welcome.success) return begun.welcome;
  DmpPlan plan;
  Answer checked = makePlan(request, execute, plan);
  if (checked.success && execute) {
    PredictedPath path;
    checked = rollOutPlan(plan, false, path);
  }
  if (!checked.success) return checked;
  const Answer answer = offer(begun, plan, false);
  if (answer.success && execute) goals_.follow(request.goal_frame, plan.goal);
  return answer;
}

bool DmpController::readPath(PredictedPath& path) {
  DmpSnapshot now;
  if (!snapshots_.read(now)) return false;
  path = {now.stamp_ns, now.primitive.str(),
          now.motion.rollOut(now.goal, now.motion.rate(), now.approach)};
  return true;
}

Answer DmpController::predict(const DmpRequest& request, PredictedPath& path) {
  DmpPlan plan;
  const Answer checked = makePlan(request, true, plan);
  return checked.success ? rollOutPlan(plan, true, path) : checked;
}

/// The path of a plan from the commanded position; refused if it leaves the workspace.
Answer DmpController::rollOutPlan(const DmpPlan& plan, bool at_rest, PredictedPath& path) {
  CycleInput input;
  input.robot = setup().host->robotSnapshot();
  if (input.robot.sequence == 0) {
    return Answer::refusal(ReasonCode::RobotDisconnected,
                           "no joint state from the arm yet; start the robot's interface first");
  }
  const ChainState arm = setup().robot->chain.evaluate(input.robot.commanded_position);
  SetPoint from;
  from.pose = arm.tool;
  if (!at_rest) from.velocity = arm.jacobian.topRows<3>() * input.robot.commanded_velocity;
  const std::lock_guard<std::mutex> lock(predict_mutex_);
  imagined_.start({plan, from, input});
  const DmpSnapshot begun = imagined_.snapshot(setup().host->now_ns());
  imagined_.stop();
  const Reason too_far =
      scaledTooFar(plan, begun.motion.dmp().startPosition(), begun.goal.position);
  if (!too_far.empty()) return Answer::refusal(too_far);
  path = {begun.stamp_ns, plan.primitive.str(),
          begun.motion.rollOut(begun.goal, 1.0, begun.approach)};
  const Answer checked = checkPath(plan, arm.tool.position, path.path);
  if (!checked.success) path = {};
  return checked;
}

/// Reason if the demonstration is too short for this distance, or empty.
Reason DmpController::scaledTooFar(const DmpPlan& plan, const Vector3& start,
                                   const Vector3& goal) const {
  const double shown = plan.dmp.demonstratedLine().norm(), way = (goal - start).norm();
  if (shown < kShortestLine || way <= max_scale_ * shown) return {};
  return Reason(ReasonCode::OutOfRange, "the goal is ")
         << way << " m away, " << way / shown << " times as far as the " << shown
         << " m that were demonstrated; allowed: " << max_scale_
         << " times (max_scale); choose another primitive";
}

/// A path may enter the workspace but not leave it. Near its end a violation is accepted, because
/// the motion then stops at the border.
Answer DmpController::checkPath(const DmpPlan& plan, const Vector3& hand,
                                const TimedPath& path) const {
  const Workspace& workspace = setup().robot->workspace;
  const auto outside = [&](const Vector3& point) {
    return (workspace.project(point) - point).norm();
  };
  double allowed = outside(hand) + kOnBorder;
  for (std::size_t i = 0; i < path.poses.size(); ++i) {
    const Vector3& in_dmp = path.poses[i].position;
    const Vector3 point = plan.base_from_dmp.position + plan.base_from_dmp.orientation * in_dmp;
    const double away = outside(point);
    if (away > allowed && (in_dmp - path.poses.back().position).norm() > arrive_distance_) {
      return Answer::refusal(
          ReasonCode::WorkspaceBorder,
          "the path of primitive '" + plan.primitive.str() + "' leaves the workspace at " +
              text(point) + ", " + std::to_string(path.times[i]) + " s after its start (" +
              describe(workspace.violated(point)) + "); choose another primitive, start or goal");
    }
    allowed = std::min(allowed, away + kOnBorder);
  }
  return {};
}

/// Checks a request and builds its plan.
Answer DmpController::makePlan(const DmpRequest& request, bool execute, DmpPlan& plan) {
  try {
    const std::lock_guard<std::mutex> lock(library_mutex_);
    plan.dmp = Dmp(library_.at(request.primitive_id));
  } catch (const std::exception& error) {
    return Answer::refusal(ReasonCode::UnknownName, error.what());
  }
  Answer checked = check(request, execute);
  if (!checked.success) return checked;
  plan.execute = execute;
  plan.primitive << request.primitive_id.c_str();
  plan.ratio = request.dmp_ratio;
  plan.orientation_control = request.orientation_control;
  plan.arrival_speed = request.arrival_speed;
  plan.predicted = !predicted_.empty() && endsWith(request.goal_frame, predicted_);
  plan.approach = request.goal_approach;
  plan.offset = request.goal_offset;
  plan.in_goal_frame = !request.goal_frame.empty();
  plan.goal_limits = request.goal_limits;
  const Eigen::Vector4d& q = request.target_orientation;
  plan.keep_orientation = !request.orientation_control || q.isZero(0.0);
  if (!plan.keep_orientation) plan.orientation = Quaternion(q[3], q[0], q[1], q[2]).normalized();
  plan.given = execute && request.initial_state == DmpRequest::kGiven;
  if (plan.given) {
    plan.initial_position = request.initial_position;
    plan.initial_velocity = request.initial_velocity;
  }
  if (dmp_frame_ != base_frame_) {
    checked = goals_.transform(base_frame_, dmp_frame_, "dmp_frame_name", plan.base_from_dmp);
  }
  if (checked.success && execute) checked = goals_.first(request.goal_frame, plan.goal);
  if (checked.success && execute) checked = checkReach(plan);
  return checked;
}

/// Checks that the hand can be at the goal, and that a given start is near the hand.
Answer DmpController::checkReach(const DmpPlan& plan) const {
  const Workspace& workspace = setup().robot->workspace;
  const Pose& to_base = plan.base_from_dmp;
  const Vector3 goal = to_base.position + to_base.orientation * plan.handAt(plan.goal).position;
  const double outside = (workspace.project(goal) - goal).norm();
  const double margin = plan.in_goal_frame ? reach_margin_ : 0.0;
  if (outside > margin + 1e-9) {
    return Answer::refusal(
        ReasonCode::GoalOutsideWorkspace,
        "the hand's goal " + text(goal) + " is " + std::to_string(outside) +
            " m outside the workspace (" + describe(workspace.violated(goal)) + "); box from " +
            text(workspace.parameters().box_min) + " to " + text(workspace.parameters().box_max) +
            ", " + std::to_string(workspace.parameters().base_radius) + " m from the base");
  }
  if (!plan.given) return {};
  const Vector3 start = to_base.position + to_base.orientation * plan.initial_position;
  const RobotSample robot = setup().host->robotSnapshot();
  const Vector3 hand = setup().robot->chain.evaluate(robot.commanded_position).tool.position;
  const double distance = (start - hand).norm();
  if (distance > max_initial_distance_) {
    return Answer::refusal(ReasonCode::OutOfRange,
                           "initial_position is " + std::to_string(distance) +
                               " m from the hand at " + text(hand) +
                               "; allowed: " + std::to_string(max_initial_distance_) +
                               " m (max_initial_distance); use initial_state CURRENT");
  }
  if (plan.initial_velocity.norm() > kFastestStart) {
    return Answer::refusal(ReasonCode::OutOfRange,
                           "initial_velocity is " + std::to_string(plan.initial_velocity.norm()) +
                               " m/s; expected at most 2 m/s");
  }
  return {};
}

}  // namespace coglab_controllers
