#include "coglab_controllers/plugins/joint_trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace coglab_controllers {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kJoinTime = 0.5;    // s in which a difference at the start fades
constexpr double kJoinShare = 0.2;   // of the arm's acceleration that this may take
constexpr double kLatest = 1.0;      // s after its stamp that a trajectory may begin
constexpr double kEarliest = 0.05;   // s before its stamp: two clocks differ by so much
constexpr double kLongest = 3600.0;  // s
constexpr std::size_t kMostPoints = 100000;
constexpr double kCheckStep = 0.005;  // s between the states that are checked
constexpr double kMostChecks = 20000.0;
constexpr double kRest = 1e-3;              // rad/s: a last point slower than this is at rest
constexpr double kRounding = 1.001;         // planners come this close to a limit
constexpr double kAccelerationSlack = 1.2;  // the arm's interpolator smooths short peaks

/// The motion in the control cycle.
class TrajectoryMotion : public Motion<TrajectoryPlan> {
 public:
  /// Number of the newest trajectory that began: the cycle no longer looks at those before it.
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
  /// A limit blocks the motion: it has ended well if the arm is where it was to go.
  bool endIfThere(const CycleInput& input) override {
    const JointVector end = trajectory_->spline.at(kInfinity).position;
    return there_ ||
           ((end - input.robot.position).array().abs() <= trajectory_->goal.position.array()).all();
  }
  /// True if the trajectory and the arm have come to the end.
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

  /// The joint that is furthest beyond a tolerance; -1: none.
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
    if (speed) {
      reason_ << std::abs(desired.velocity[i] - actual.velocity[i])
              << " rad/s off its speed; the tolerance of " << what << " is "
              << tolerance.velocity[i] << " rad/s";
    } else {
      reason_ << std::abs(desired.position[i] - actual.position[i])
              << " rad off its set-point; the tolerance of " << what << " is "
              << tolerance.position[i] << " rad";
    }
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
  return policy;
}

/// A sentence that is put together while the request is read, and thrown to end the reading.
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

/// Reads a goal against a robot. Throws Refused.
class Reader {
 public:
  Reader(const RobotSetup& robot, const TrajectoryRequest& request)
      : robot_(robot), request_(request), names_(robot.chain.jointNames()) {}

  void checkStamp() const {
    if (!std::isfinite(request_.age) || request_.age < -kEarliest) {
      refuse(TrajectoryError::InvalidGoal, ReasonCode::GoalFromFuture, "the trajectory begins in ",
             -request_.age,
             " s by its stamp; send it when it shall begin, or with stamp 0 to begin at once");
    }
    if (request_.age > kLatest) {
      refuse(TrajectoryError::OldHeaderTimestamp, ReasonCode::TooLate, "the trajectory is ",
             request_.age, " s old by its stamp; allowed: ", kLatest,
             " s; send it anew, or with stamp 0 to begin at once");
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
    if (points.size() > kMostPoints)
      invalid("the trajectory has ", points.size(), " points; expected at most ", kMostPoints);
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
      // Before speeds, which are too high where a position is too far.
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

  /// Lets the path begin at the arm's set-point.
  void join(std::vector<JointPoint>& points, const RobotSample& now, double tolerance) const {
    if (points.front().time > 0.0) {
      JointPoint begin;
      begin.position = now.commanded_position;
      begin.velocity = now.commanded_velocity;
      points.insert(points.begin(), begin);
    } else {
      int joint = 0;
      const JointVector away = points.front().position - now.commanded_position;
      if (away.cwiseAbs().maxCoeff(&joint) > tolerance) {
        outOfRange("the trajectory begins ", std::abs(away[joint]), " rad from where joint ",
                   name(joint), " is (", now.commanded_position[joint],
                   " rad); allowed: ", tolerance, " rad (start_tolerance); plan again from there");
      }
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

  /// Every state on the way against limits and workspace.
  void checkWay(const JointSpline& spline) const {
    const coglab_rt::JointLimits& limits = robot_.limits;
    const double step = std::max(kCheckStep, spline.duration() / kMostChecks);
    bool inside = false;  // has been, of the workspace: a path may lead into it
    for (double time = 0.0;; time += step) {
      const bool last = time >= spline.duration();
      const JointPoint point = spline.at(time);
      if (time > 0.0) checkPosition(point);
      const auto slow = [&](const char* what, const JointVector& values, const JointVector& most,
                            double slack, const char* unit) {
        int joint = 0;
        const auto share = values.array().abs() / most.array();
        if (share.maxCoeff(&joint) <= slack) return;
        outOfRange("joint ", name(joint), " has ", what, " ", values[joint], " ", unit, " at ",
                   time, " s; allowed: ", most[joint], " ", unit, "; make it slower");
      };
      slow("velocity", point.velocity, limits.velocity, kRounding, "rad/s");
      slow("acceleration", point.acceleration, limits.acceleration, kAccelerationSlack, "rad/s^2");
      const WorkspaceBorder border =
          robot_.workspace.violated(robot_.chain.evaluate(point.position).tool.position);
      if (border == WorkspaceBorder::None) inside = true;
      if (border != WorkspaceBorder::None && (inside || last)) {
        refuse(TrajectoryError::InvalidGoal, ReasonCode::GoalOutsideWorkspace,
               "the hand leaves the workspace at ", time, " s: ", describe(border));
      }
      if (last) return;
    }
  }

  TrajectoryTolerance readTolerance(const char* field,
                                    const std::vector<TrajectoryRequest::Tolerance>& given,
                                    double fallback) const {
    TrajectoryTolerance read;
    read.position.setConstant(fallback);
    for (const TrajectoryRequest::Tolerance& one : given) {
      const int joint = jointNamed(one.joint);
      if (joint < 0) invalidJoints(field, " has '", one.joint, "', which is no joint of the arm");
      if (!std::isfinite(one.position) || !std::isfinite(one.velocity))
        invalid(field, " of ", one.joint, " is not finite; expected rad and rad/s");
      if (one.position != 0.0) read.position[joint] = one.position > 0 ? one.position : kInfinity;
      if (one.velocity > 0.0) read.velocity[joint] = one.velocity;
    }
    return read;
  }

  bool quintic() const { return accelerations(); }

 private:
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

  /// @param wanted false: the first point has none, and so has this one
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

TrajectoryAnswer JointTrajectory::read(const TrajectoryRequest& request,
                                       JointPath& trajectory) const {
  TrajectoryAnswer answer;
  try {
    const RobotSample now = setup().host->robotSnapshot();
    if (now.sequence == 0) {
      refuse(TrajectoryError::InvalidGoal, ReasonCode::StaleJointState,
             "no joint state from the robot yet; start the robot's interface first");
    }
    Reader reader(*setup().robot, request);
    reader.checkStamp();
    reader.readNames();
    std::vector<JointPoint> points = reader.readPoints();
    trajectory.path =
        reader.readTolerance("path_tolerance", request.path_tolerance, path_tolerance_);
    trajectory.goal =
        reader.readTolerance("goal_tolerance", request.goal_tolerance, goal_tolerance_);
    trajectory.goal_time =
        request.goal_time_tolerance > 0.0 ? request.goal_time_tolerance : goal_time_;
    reader.join(points, now, start_tolerance_);
    trajectory.spline = JointSpline(std::move(points), reader.quintic());
    reader.checkWay(trajectory.spline);
  } catch (const Refused& refused) {
    static_cast<Answer&>(answer) = Answer::refusal(refused.code, refused.sentence);
    answer.error = refused.error;
  }
  return answer;
}

TrajectoryAnswer JointTrajectory::check(const TrajectoryRequest& request) const {
  JointPath trajectory;
  return read(request, trajectory);
}

TrajectoryAnswer JointTrajectory::follow(const TrajectoryRequest& request) {
  TrajectoryAnswer answer;
  const MotionRequest begun = setup().host->beginRequest(id());
  if (begun.welcome.success) {
    auto trajectory = std::make_unique<JointPath>();
    answer = read(request, *trajectory);
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
