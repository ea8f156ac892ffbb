#include "coglab_controllers/plugins/ptp_controller.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace coglab_controllers {

namespace {

/// Reads seven numbers and checks them against limits.
Answer readJoints(const std::vector<double>& values, const char* field,
                  const std::vector<std::string>& names, const JointVector& least,
                  const JointVector& most, const char* unit, JointVector& out) {
  std::ostringstream why;
  if (values.size() != static_cast<std::size_t>(kMaxJoints)) {
    why << field << " has " << values.size() << " numbers; expected " << kMaxJoints
        << ", in the order";
    for (const std::string& name : names) why << " " << name;
    return Answer::invalid(why.str());
  }
  for (int joint = 0; joint < kMaxJoints; ++joint) {
    const double value = values[joint];
    if (!std::isfinite(value) || value < least[joint] || value > most[joint]) {
      why << field << " of " << names[joint] << " is " << value << " " << unit << "; expected "
          << least[joint] << " to " << most[joint];
      return Answer::refusal(
          std::isfinite(value) ? ReasonCode::OutOfRange : ReasonCode::InvalidArgument, why.str());
    }
    out[joint] = value;
  }
  return {};
}

/// The motion in the control cycle: along a trajectory, which ends at rest.
class PtpMotion : public Motion<PtpTarget> {
 public:
  void configure(MotionConfiguration& configuration) override {
    joints_ = configuration.robot.chain.joints();
    tolerance_ = configuration.parameters.number("tolerance", tolerance_, 1e-5, 0.1);
  }
  void start(const MotionStart<PtpTarget>& start) override {
    const PtpTarget& to = start.request;
    trajectory_ = PtpTrajectory(start.from.joints, start.from.joint_velocity, to.position,
                                to.velocity, to.acceleration, joints_);
    time_ = 0.0;
    rate_ = 1.0;
  }
  void computeReference(const MotionCycle& cycle, MotionReference& reference) override {
    PtpPoint now, next;
    trajectory_.at(cycle.time, now);
    trajectory_.at(cycle.next, next);
    reference.joints(now.position, next.position);
    time_ = cycle.next;
    rate_ = cycle.input.time_scale;
  }
  bool endIfThere(const CycleInput& input) override {
    PtpPoint end;
    trajectory_.at(trajectory_.duration(), end);
    return (end.position - input.robot.position).lpNorm<Eigen::Infinity>() <= tolerance_;
  }
  MotionState state() const override {
    return time_ >= trajectory_.duration() ? MotionState::Reached : MotionState::Running;
  }

  PtpSnapshot snapshot(std::int64_t stamp_ns, int id) const {
    return {stamp_ns, id, trajectory_, time_, rate_};
  }

 private:
  int joints_ = kMaxJoints;
  double tolerance_ = 0.002;  // rad
  PtpTrajectory trajectory_;
  double time_ = 0.0, rate_ = 1.0;
};

RunnerPolicy ptpPolicy() {
  RunnerPolicy policy;
  policy.id_name = "ptp_id";
  policy.spaces = ReferenceLoop::Spaces::Joint;
  return policy;
}

}  // namespace

PtpController::PtpController()
    : MotionRunner<PtpTarget>(std::make_unique<PtpMotion>(), ptpPolicy()) {}

void PtpController::configure(const MotionSetup& setup) {
  if (setup.robot->chain.joints() != kMaxJoints) {
    throw std::runtime_error("the chain has not seven joints; point-to-point motions need all");
  }
  const Parameters parameters(setup.parameters, setup.id);
  MotionRunner<PtpTarget>::configure(setup);
  tolerance_ = parameters.number("tolerance", tolerance_, 1e-5, 0.1);
  default_speed_ = &tunables()->add(
      parameters, "default_speed",
      "share of the joints' speed limits, of a request that gives none", 0.3, 0.01, 1.0);
  default_acceleration_ = &tunables()->add(
      parameters, "default_acceleration",
      "share of the joints' acceleration limits, of a request that gives none", 0.2, 0.01, 1.0);
}

Answer PtpController::readTarget(const PtpRequest& request, PtpTarget& target) const {
  const coglab_rt::JointLimits& limits = setup().robot->limits;
  const Chain& chain = setup().robot->chain;
  const std::vector<std::string>& names = chain.jointNames();
  // The guard stops at its margin. With measurement noise a target on that border might not be
  // reached.
  const JointVector margin =
      JointVector::Constant(setup().robot->guard.position_margin + tolerance_);
  const JointVector least = JointVector::Constant(1e-4);
  target.velocity = default_speed_->wanted() * limits.velocity;
  target.acceleration = default_acceleration_->wanted() * limits.acceleration;
  Answer answer = readJoints(request.position, "position", names, limits.lower_position + margin,
                             limits.upper_position - margin, "rad", target.position);
  if (answer.success && !request.max_vel.empty()) {
    answer = readJoints(request.max_vel, "max_vel", names, least, limits.velocity, "rad/s",
                        target.velocity);
  }
  if (answer.success && !request.max_acc.empty()) {
    answer = readJoints(request.max_acc, "max_acc", names, least, limits.acceleration, "rad/s^2",
                        target.acceleration);
  }
  if (!answer.success) return answer;
  const WorkspaceBorder border =
      setup().robot->workspace.violated(chain.evaluate(target.position).tool.position);
  if (border == WorkspaceBorder::None) return {};
  return Answer::refusal(
      ReasonCode::GoalOutsideWorkspace,
      std::string("position puts the hand outside the workspace: ") + describe(border));
}

void PtpController::report(std::int64_t stamp_ns) {
  moving_.store(stage() != RunnerStage::Rest, std::memory_order_relaxed);
  if (stage() != RunnerStage::Moving) return;
  snapshots_.give(
      [&] { return static_cast<const PtpMotion&>(inner()).snapshot(stamp_ns, runningId()); });
}

bool PtpController::readPath(PredictedPath& path) {
  PtpSnapshot now;
  if (!snapshots_.read(now)) return false;
  path = {now.stamp_ns, "ptp " + std::to_string(now.id), {}};
  const double rate = std::clamp(now.rate, kSlowestClock, 1.0);
  const double left = std::max(0.0, now.trajectory.duration() - now.time);
  for (int i = 0; i <= kPathPoints; ++i) {
    const double ahead = left * i / kPathPoints;
    PtpPoint point;
    now.trajectory.at(now.time + ahead, point);
    path.path.times.push_back(ahead / rate);
    path.path.poses.push_back(setup().robot->chain.evaluate(point.position).tool);
    if (left == 0.0) break;  // times grow
  }
  return true;
}

MotionAnswer PtpController::add(const PtpRequest& request) {
  const MotionRequest begun = setup().host->beginRequest(id());
  if (!begun.welcome.success) return MotionAnswer::rejected(begun.welcome);
  PtpTarget target;
  const Answer read = readTarget(request, target);
  if (!read.success) return MotionAnswer::rejected(read);
  return offer(begun, target, true);
}

}  // namespace coglab_controllers
