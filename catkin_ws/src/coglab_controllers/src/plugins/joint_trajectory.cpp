#include "coglab_controllers/plugins/joint_trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace coglab_controllers {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kJoinTime = 0.5;    // s, time in which a difference at the start fades out
constexpr double kJoinShare = 0.2;   // share of the arm's acceleration for this fade
constexpr double kLatest = 1.0;      // s, latest begin of a trajectory after its stamp
constexpr double kEarliest = 0.05;   // s, earliest begin before its stamp: difference of two clocks
constexpr double kLongest = 3600.0;  // s
constexpr double kErased = -1.0;     // value with which a client removes a tolerance
constexpr double kCheckStep = 0.005;  // s between checked states
constexpr double kMostChecks = 20000.0;
constexpr int kLeastChecks = 4;             // smallest number of checks between two points
constexpr double kRest = 1e-3;              // rad/s, speed below which the last point is at rest
constexpr double kRounding = 1.001;         // tolerance for planners that use a limit exactly
constexpr double kAccelerationSlack = 1.2;  // the arm's interpolator smooths short peaks

/// Appends a number with six decimals (to show an error just beyond a tolerance), without trailing
/// zeros. Control thread.
void append(Reason& reason, double value) noexcept {
  std::uint64_t millionths = static_cast<std::uint64_t>(std::min(value, 1e9) * 1e6 + 0.5);
  reason << millionths / 1000000;
  millionths %= 1000000;
  if (millionths == 0) return;
  reason << ".";
  for (std::uint64_t digit = 100000; millionths > 0; digit /= 10) {
    reason << millionths / digit;
    millionths %= digit;
  }
}

/// The motion in the control cycle.
class TrajectoryMotion : public Motion<TrajectoryPlan> {
 public:
  /// Number of the newest trajectory that began. The cycle no longer uses earlier ones.
  std::atomic<std::uint64_t> begun{0};

  void configure(MotionConfiguration& configuration) override {
    names_ = configuration.robot.chain.jointNames();
  }

  void start(const MotionStart<TrajectoryPlan>& start) override {
    trajectory_ = start.request.trajectory;
    begun.store(trajectory_->number, std::memory_order_release);
    const JointPoint first = trajectory_->spline.at(0.0);
    offset_ = JointPoint();
    offset_.position = start.from.joints - first.position;
    offset_.velocity = start.from.joint_velocity - first.velocity;
    joined_ = JointPoint();
    joined_.time = std::min(kJoinTime, trajectory_->spline.duration());
    state_ = MotionState::Running;
    reason_.clear();
    there_ = false;
    waited_ = 0.0;
  }

  void computeReference(const MotionCycle& cycle, MotionReference& reference) override {
    const RobotSample& robot = cycle.input.robot;
    const JointPoint now = at(cycle.time);
    reference.joints(now.position, at(cycle.next).position);
    progress_.desired = now;
    progress_.desired.velocity *= cycle.input.time_scale;
    progress_.actual.time = cycle.time;
    progress_.actual.position = robot.position;
    progress_.actual.velocity = robot.velocity;
    if (cycle.time < trajectory_->spline.duration()) {
      watch(trajectory_->path, ReasonCode::Leashed, "the path");
    } else {
      arrive(cycle.input.dt);
    }
  }

  MotionState state() const override { return state_; }
  const Reason& reason() const override { return reason_; }
  /// Called if a limit blocks the motion. The motion has succeeded if the arm is at its goal.
  bool endIfThere(const CycleInput& input) override {
    const JointVector end = trajectory_->spline.at(kInfinity).position;
    return there_ ||
           ((end - input.robot.position).array().abs() <= trajectory_->goal.position.array()).all();
  }
  /// True if the trajectory and the arm have reached the end.
  bool there() const { return there_; }
  const TrajectoryProgress& progress() const { return progress_; }

 private:
  JointPoint at(double time) const noexcept {
    JointPoint point = trajectory_->spline.at(time);
    if (time >= joined_.time) return point;
    const JointPoint offset = hermite(offset_, joined_, true, time);
    point.position += offset.position;
    point.velocity += offset.velocity;
    point.acceleration += offset.acceleration;
    return point;
  }

  /// The joint with the largest violation of a tolerance; -1: none.
  int beyond(const TrajectoryTolerance& tolerance, bool& speed) const noexcept {
    const JointPoint &desired = progress_.desired, &actual = progress_.actual;
    int joint = -1;
    const auto position =
        (desired.position - actual.position).array().abs() / tolerance.position.array();
    const auto velocity =
        (desired.velocity - actual.velocity).array().abs() / tolerance.velocity.array();
    if (position.maxCoeff(&joint) > 1.0) return joint;
    speed = true;
    return velocity.maxCoeff(&joint) > 1.0 ? joint : -1;
  }

  void watch(const TrajectoryTolerance& tolerance, ReasonCode code, const char* what) noexcept {
    bool speed = false;
    const int i = beyond(tolerance, speed);
    if (i < 0) return;
    const JointPoint &desired = progress_.desired, &actual = progress_.actual;
    state_ = MotionState::Aborted;
    reason_ = Reason(code, "joint ") << names_[static_cast<std::size_t>(i)].c_str() << " is ";
    const double off =
        speed ? desired.velocity[i] - actual.velocity[i] : desired.position[i] - actual.position[i];
    const double most = speed ? tolerance.velocity[i] : tolerance.position[i];
    const char* const unit = speed ? " rad/s" : " rad";
    append(reason_, std::abs(off));
    reason_ << unit << (speed ? " off its speed" : " off its set-point")
            << ", more than the tolerance of " << what << ", ";
    append(reason_, most);
    reason_ << unit;
  }

  void arrive(double dt) noexcept {
    bool speed = false;
    there_ = beyond(trajectory_->goal, speed) < 0;
    if (there_) return;
    waited_ += dt;
    if (waited_ > trajectory_->goal_time)
      watch(trajectory_->goal, ReasonCode::TargetNotReached, "the goal");
  }

  std::vector<std::string> names_;
  const JointPath* trajectory_ = nullptr;
  JointPoint offset_,
      joined_;  // of the set-point to the trajectory, at the start and where it is 0
  MotionState state_ = MotionState::Idle;
  Reason reason_;
  bool there_ = false;
  double waited_ = 0.0;  // s since the end of the trajectory
  TrajectoryProgress progress_;
};

RunnerPolicy trajectoryPolicy() {
  RunnerPolicy policy;
  policy.id_name = nullptr;
  policy.longest_queue = 0;
  policy.spaces = ReferenceLoop::Spaces::Joint;
  return policy;
}

/// Error message of a request; thrown to end the reading.
struct Refused {
  TrajectoryError error;
  ReasonCode code;
  std::string sentence;
};

template <typename... Parts>
[[noreturn]] void refuse(TrajectoryError error, ReasonCode code, const Parts&... parts) {
  std::ostringstream text;
  (text << ... << parts);
  throw Refused{error, code, text.str()};
}

template <typename... Parts>
[[noreturn]] void invalid(const Parts&... parts) {
  refuse(TrajectoryError::InvalidGoal, ReasonCode::InvalidArgument, parts...);
}

template <typename... Parts>
[[noreturn]] void outOfRange(const Parts&... parts) {
  refuse(TrajectoryError::InvalidGoal, ReasonCode::OutOfRange, parts...);
}

/// Reads a goal and checks it for a robot. Throws Refused.
class Reader {
 public:
  Reader(const RobotSetup& robot, const TrajectoryRequest& request)
      : robot_(robot), request_(request), names_(robot.chain.jointNames()) {}

  /// @param begins false: the trajectory waits for the time of its stamp
  void checkStamp(bool begins) const {
    const double longest = begins ? kEarliest : TrajectoryRequest::kLongestWait;
    if (!std::isfinite(request_.age) || request_.age < -longest) {
      refuse(TrajectoryError::InvalidGoal, ReasonCode::GoalFromFuture, "the trajectory begins in ",
             -request_.age, " s by its stamp; expected at most ", longest,
             " s; send it later, or with stamp 0 to begin at once");
    }
    if (request_.age > kLatest) {
      refuse(TrajectoryError::OldHeaderTimestamp, ReasonCode::TooLate, "the trajectory is ",
             request_.age, " s old by its stamp; allowed: ", kLatest,
             " s; send it again, or with stamp 0 to begin at once");
    }
  }

  void readNames() {
    std::string wanted;
    for (const std::string& name : names_) wanted += (wanted.empty() ? "" : ", ") + name;
    for (const std::string& name : request_.joint_names) {
      const int joint = jointNamed(name);
      if (joint < 0) invalidJoints("joint_names has '", name, "', which is no joint of the arm");
      if (std::count(order_.begin(), order_.end(), joint) > 0)
        invalidJoints("joint_names has '", name, "' twice");
      order_.push_back(joint);
    }
    if (order_.size() == names_.size()) return;
    invalidJoints("joint_names has ", order_.size(), " names; expected all ", names_.size(), ": ",
                  wanted);
  }

  std::vector<JointPoint> readPoints() {
    const auto& points = request_.points;
    if (points.empty()) invalid("the trajectory has no points; expected one or more");
    if (points.size() > TrajectoryRequest::kMostPoints) {
      invalid("the trajectory has ", points.size(), " points; expected at most ",
              TrajectoryRequest::kMostPoints,
              "; leave out points between which the path is smooth");
    }
    std::vector<JointPoint> read;
    for (std::size_t k = 0; k < points.size(); ++k) {
      const TrajectoryRequest::Point& point = points[k];
      const double least = k == 0 ? 0.0 : points[k - 1].time;
      if (!(point.time >= least) || (k > 0 && point.time == least) || point.time > kLongest) {
        invalid("point ", k, " is at ", point.time, " s from the start; expected ",
                k == 0 ? "0 or more" : "more than the point before it, which is at ",
                k == 0 ? "" : std::to_string(least), ", and at most ", kLongest, " s");
      }
      JointPoint one;
      one.time = point.time;
      numbers(k, "positions", point.positions, true, one.position);
      numbers(k, "velocities", point.velocities, velocities(), one.velocity);
      numbers(k, "accelerations", point.accelerations, accelerations(), one.acceleration);
      // Before the speeds, because a position too far away causes a speed that is too high.
      if (one.time > 0.0) checkPosition(one);
      read.push_back(one);
    }
    if (accelerations() && !velocities())
      invalid("the points have accelerations and no velocities; expected both or no accelerations");
    int joint = 0;
    if (read.back().velocity.cwiseAbs().maxCoeff(&joint) > kRest) {
      invalid("the trajectory ends with joint ", name(joint), " at ", read.back().velocity[joint],
              " rad/s; expected a last point at rest");
    }
    return read;
  }

  /// Makes the path begin at the arm's set-point.
  /// @param start, goal start_tolerance and goal_tolerance, rad
  void join(std::vector<JointPoint>& points, const RobotSample& now, double start,
            double goal) const {
    if (points.front().time > 0.0) {
      JointPoint begin;
      begin.position = now.commanded_position;
      begin.velocity = now.commanded_velocity;
      points.insert(points.begin(), begin);
    } else {
      checkStart(points.front().position - now.commanded_position, points.back().time, start, goal);
    }
    if (!velocities()) {
      if (points.front().time == 0.0 && points.size() > 1)
        points.front().velocity = now.commanded_velocity;
      JointSpline::estimateVelocities(points);
    }
    const JointVector faster = (points.front().velocity - now.commanded_velocity).cwiseAbs();
    const JointVector most = kJoinShare * kJoinTime * robot_.limits.acceleration;
    for (int i = 0; i < robot_.chain.joints(); ++i) {
      if (faster[i] <= most[i]) continue;
      outOfRange("the trajectory begins with joint ", name(i), " at ", points.front().velocity[i],
                 " rad/s, and it moves at ", now.commanded_velocity[i],
                 " rad/s; they may differ by ", most[i], " rad/s");
    }
  }

  /// For a trajectory that begins later: the way to its first point is checked at its begin.
  void leaveStartOpen(std::vector<JointPoint>& points) const {
    if (!velocities()) JointSpline::estimateVelocities(points);
  }

  /// Checks all states of the path against limits and workspace.
  void checkWay(const std::vector<JointPoint>& points) const {
    const double step = std::max(kCheckStep, points.back().time / kMostChecks);
    bool inside = false;  // true once the path was inside the workspace; it may begin outside
    for (std::size_t k = 1; k < points.size(); ++k) {
      const JointPoint &from = points[k - 1], &to = points[k];
      const double length = to.time - from.time;
      const int parts = std::max(kLeastChecks, static_cast<int>(std::ceil(length / step)));
      for (int part = 0; part <= parts; ++part) {
        checkState(hermite(from, to, quintic(), from.time + part * length / parts), false, inside);
      }
    }
    checkState(points.back(), true, inside);
  }

  TrajectoryTolerance readTolerance(const char* field,
                                    const std::vector<TrajectoryRequest::Tolerance>& given,
                                    double fallback) const {
    TrajectoryTolerance read;
    read.position.setConstant(fallback);
    for (const TrajectoryRequest::Tolerance& one : given) {
      const int joint = jointNamed(one.joint);
      if (joint < 0) invalidJoints(field, " has '", one.joint, "', which is no joint of the arm");
      for (const double number : {one.position, one.velocity, one.acceleration}) {
        if (std::isfinite(number) && (number >= 0.0 || number == kErased)) continue;
        invalid(field, " of ", one.joint, " has ", number,
                "; expected a positive number (rad, rad/s), 0 for the default, or -1 for no bound");
      }
      if (one.position != 0.0) read.position[joint] = one.position > 0 ? one.position : kInfinity;
      if (one.velocity > 0.0) read.velocity[joint] = one.velocity;
    }
    return read;
  }

  /// s, time after the end of the trajectory for the arm to come within its goal tolerance.
  double readGoalTime(double fallback) const {
    const double given = request_.goal_time_tolerance;
    if (!(given >= 0.0 && given <= kLongest)) {
      invalid("goal_time_tolerance is ", given, " s; expected 0 for the default, ", fallback,
              " s, or up to ", kLongest, " s");
    }
    return given > 0.0 ? given : fallback;
  }

  bool quintic() const { return accelerations(); }

 private:
  /// Checks that the arm is at the start of the trajectory, or close enough to fade the difference.
  void checkStart(const JointVector& away, double duration, double start, double goal) const {
    const double time = std::min(kJoinTime, duration);
    for (int i = 0; i < robot_.chain.joints(); ++i) {
      // The third-order fade of a difference d within T needs accelerations up to 6 d / T^2.
      const double fades = kJoinShare * robot_.limits.acceleration[i] * time * time / 6.0;
      const double most = std::min(start, std::max(goal, fades));
      if (std::abs(away[i]) <= most) continue;
      outOfRange("the trajectory begins ", std::abs(away[i]), " rad from where joint ", name(i),
                 " is; allowed: ", most,
                 most < start
                     ? " rad, because the trajectory is too short for a larger difference; "
                       "give it a time to go there"
                     : " rad (start_tolerance); plan again from there");
    }
  }

  /// @param inside in: the path was inside the workspace before this state; out: also with it
  void checkState(const JointPoint& point, bool last, bool& inside) const {
    const coglab_rt::JointLimits& limits = robot_.limits;
    if (point.time > 0.0) checkPosition(point);
    const auto slow = [&](const char* what, const JointVector& values, const JointVector& most,
                          double slack, const char* unit) {
      int joint = 0;
      const auto share = values.array().abs() / most.array();
      if (share.maxCoeff(&joint) <= slack) return;
      outOfRange("joint ", name(joint), " has ", what, " ", values[joint], " ", unit, " at ",
                 point.time, " s; allowed: ", most[joint], " ", unit,
                 point.time < request_.points.front().time
                     ? ", on the way from the arm to the first point; give that point more time, "
                       "or let it be at 0 s"
                     : "; make it slower");
    };
    slow("velocity", point.velocity, limits.velocity, kRounding, "rad/s");
    slow("acceleration", point.acceleration, limits.acceleration, kAccelerationSlack, "rad/s^2");
    const WorkspaceBorder border =
        robot_.workspace.violated(robot_.chain.evaluate(point.position).tool.position);
    if (border == WorkspaceBorder::None) inside = true;
    if (border != WorkspaceBorder::None && (inside || last)) {
      refuse(TrajectoryError::InvalidGoal, ReasonCode::GoalOutsideWorkspace,
             "the hand leaves the workspace at ", point.time, " s: ", describe(border));
    }
  }

  bool velocities() const { return !request_.points.front().velocities.empty(); }
  bool accelerations() const { return !request_.points.front().accelerations.empty(); }
  const std::string& name(int joint) const { return names_[static_cast<std::size_t>(joint)]; }
  int jointNamed(const std::string& name) const {
    const auto found = std::find(names_.begin(), names_.end(), name);
    return found == names_.end() ? -1 : static_cast<int>(found - names_.begin());
  }

  void checkPosition(const JointPoint& point) const {
    const double margin = robot_.guard.position_margin;
    for (int i = 0; i < robot_.chain.joints(); ++i) {
      const double least = robot_.limits.lower_position[i] + margin;
      const double most = robot_.limits.upper_position[i] - margin;
      if (point.position[i] >= least && point.position[i] <= most) continue;
      outOfRange("joint ", name(i), " has position ", point.position[i], " rad at ", point.time,
                 " s; expected ", least, " to ", most, " rad");
    }
  }

  template <typename... Parts>
  [[noreturn]] static void invalidJoints(const Parts&... parts) {
    refuse(TrajectoryError::InvalidJoints, ReasonCode::UnknownName, parts...);
  }

  /// @param wanted false: the first point has no such numbers, so this one must have none
  void numbers(std::size_t k, const char* field, const std::vector<double>& values, bool wanted,
               JointVector& out) const {
    const std::size_t size = wanted ? order_.size() : 0;
    if (values.size() != size) {
      invalid(field, " of point ", k, " has ", values.size(), " numbers; expected ", size,
              k > 0 ? ", as in the points before it" : ", one for each joint");
    }
    for (std::size_t i = 0; i < size; ++i) {
      if (!std::isfinite(values[i]))
        invalid(field, " of point ", k, " is not finite for joint ", name(order_[i]));
      out[order_[i]] = values[i];
    }
  }

  const RobotSetup& robot_;
  const TrajectoryRequest& request_;
  const std::vector<std::string>& names_;
  std::vector<int> order_;  // index of each name of the request
};

}  // namespace

JointTrajectory::JointTrajectory()
    : MotionRunner<TrajectoryPlan>(std::make_unique<TrajectoryMotion>(), trajectoryPolicy()) {}

void JointTrajectory::configure(const MotionSetup& setup) {
  const Parameters parameters(setup.parameters, setup.id);
  path_tolerance_ = parameters.number("path_tolerance", path_tolerance_, 1e-3, 10.0);
  goal_tolerance_ = parameters.number("goal_tolerance", goal_tolerance_, 1e-4, 1.0);
  start_tolerance_ = parameters.number("start_tolerance", start_tolerance_, 1e-4, 0.2);
  goal_time_ = parameters.number("goal_time", goal_time_, 0.0, 60.0);
  MotionRunner<TrajectoryPlan>::configure(setup);
}

TrajectoryAnswer JointTrajectory::read(const TrajectoryRequest& request, bool begins,
                                       JointPath& trajectory) const {
  TrajectoryAnswer answer;
  try {
    const RobotSample now = setup().host->robotSnapshot();
    if (now.sequence == 0) {
      refuse(TrajectoryError::InvalidGoal, ReasonCode::StaleJointState,
             "no joint state from the robot yet; start the robot's interface first");
    }
    Reader reader(*setup().robot, request);
    reader.checkStamp(begins);
    reader.readNames();
    std::vector<JointPoint> points = reader.readPoints();
    trajectory.path =
        reader.readTolerance("path_tolerance", request.path_tolerance, path_tolerance_);
    trajectory.goal =
        reader.readTolerance("goal_tolerance", request.goal_tolerance, goal_tolerance_);
    trajectory.goal_time = reader.readGoalTime(goal_time_);
    if (begins) {
      reader.join(points, now, start_tolerance_, goal_tolerance_);
    } else {
      reader.leaveStartOpen(points);
    }
    reader.checkWay(points);
    trajectory.spline = JointSpline(std::move(points), reader.quintic());
  } catch (const Refused& refused) {
    static_cast<Answer&>(answer) = Answer::refusal(refused.code, refused.sentence);
    answer.error = refused.error;
  }
  return answer;
}

TrajectoryAnswer JointTrajectory::check(const TrajectoryRequest& request) const {
  JointPath trajectory;
  return read(request, request.age >= 0.0, trajectory);
}

TrajectoryAnswer JointTrajectory::accept(WaitingTrajectory& waiting) {
  const MotionRequest begun = setup().host->beginRequest(id());
  waiting.accepted = begun.stamp;
  TrajectoryAnswer answer;
  if (begun.welcome.success) {
    answer = check(waiting.request);
  } else {
    static_cast<Answer&>(answer) = begun.welcome;
    answer.error = TrajectoryError::InvalidGoal;
  }
  return answer;
}

TrajectoryAnswer JointTrajectory::follow(const TrajectoryRequest& request) {
  return begin(request, nullptr);
}

TrajectoryAnswer JointTrajectory::follow(const WaitingTrajectory& waiting) {
  TrajectoryRequest request = waiting.request;
  request.age = 0.0;
  return begin(request, &waiting.accepted);
}

TrajectoryAnswer JointTrajectory::begin(const TrajectoryRequest& request,
                                        const RequestStamp* accepted) {
  TrajectoryAnswer answer;
  MotionRequest begun = setup().host->beginRequest(id());
  if (accepted != nullptr) begun.stamp = *accepted;
  if (begun.welcome.success) {
    auto trajectory = std::make_unique<JointPath>();
    answer = read(request, true, *trajectory);
    if (!answer.success) return answer;
    const auto& motion = static_cast<const TrajectoryMotion&>(inner());
    const std::uint64_t in_use = motion.begun.load(std::memory_order_acquire);
    while (!kept_.empty() && kept_.front()->number < in_use) kept_.pop_front();
    trajectory->number = ++made_;
    const TrajectoryPlan plan{trajectory.get()};
    kept_.push_back(std::move(trajectory));
    static_cast<MotionAnswer&>(answer) = offer(begun, plan, false);
  } else {
    static_cast<MotionAnswer&>(answer) = MotionAnswer::rejected(begun.welcome);
  }
  if (!answer.success) answer.error = TrajectoryError::InvalidGoal;
  return answer;
}

TrajectoryError JointTrajectory::errorOf(const EndedMotion& end) {
  if (end.executed) return TrajectoryError::None;
  switch (end.reason.code()) {
    case ReasonCode::Cancelled:
    case ReasonCode::Superseded:
      return TrajectoryError::None;
    case ReasonCode::TargetNotReached:
      return TrajectoryError::GoalToleranceViolated;
    default:
      return TrajectoryError::PathToleranceViolated;
  }
}

void JointTrajectory::computeReference(const CycleInput& input, References& references) {
  if (stage() == RunnerStage::Moving && static_cast<const TrajectoryMotion&>(inner()).there())
    endIfThere(input);
  MotionRunner<TrajectoryPlan>::computeReference(input, references);
}

void JointTrajectory::report(std::int64_t stamp_ns) {
  TrajectoryProgress now = static_cast<const TrajectoryMotion&>(inner()).progress();
  now.stamp_ns = stamp_ns;
  now.id = runningId();
  now.moving = stage() == RunnerStage::Moving;
  progress_.write(now);
}

}  // namespace coglab_controllers
