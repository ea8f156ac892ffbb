// ROS side of joint trajectories: the action used by MoveIt and other planners.
#include <map>
#include <mutex>
#include <optional>

#include <control_msgs/FollowJointTrajectoryAction.h>
#include <control_msgs/JointTrajectoryControllerState.h>
#include <ros/callback_queue_interface.h>
#include <ros/ros.h>

#include "coglab_controllers/manager/plugin_registry.hpp"
#include "coglab_controllers/plugins/joint_trajectory.hpp"
#include "coglab_controllers/ros/action_server.hpp"
#include "coglab_controllers/ros/motion_controller_ros.hpp"

namespace coglab_controllers {

namespace {

using Action = control_msgs::FollowJointTrajectoryAction;
using Server = ActionServer<Action>;
using Result = control_msgs::FollowJointTrajectoryResult;

constexpr std::size_t kLargest = 4'000'000;  // bytes of a goal; 10000 full points have 2.5 million

constexpr bool same(TrajectoryError ours, int theirs) { return static_cast<int>(ours) == theirs; }

// The core is independent of ROS and has its own copy of the numbers of the action.
static_assert(same(TrajectoryError::None, Result::SUCCESSFUL));
static_assert(same(TrajectoryError::InvalidGoal, Result::INVALID_GOAL));
static_assert(same(TrajectoryError::InvalidJoints, Result::INVALID_JOINTS));
static_assert(same(TrajectoryError::OldHeaderTimestamp, Result::OLD_HEADER_TIMESTAMP));
static_assert(same(TrajectoryError::PathToleranceViolated, Result::PATH_TOLERANCE_VIOLATED));
static_assert(same(TrajectoryError::GoalToleranceViolated, Result::GOAL_TOLERANCE_VIOLATED));

std::vector<TrajectoryRequest::Tolerance> read(
    const std::vector<control_msgs::JointTolerance>& tolerances) {
  std::vector<TrajectoryRequest::Tolerance> read;
  for (const auto& one : tolerances)
    read.push_back({one.name, one.position, one.velocity, one.acceleration});
  return read;
}

TrajectoryRequest read(const control_msgs::FollowJointTrajectoryGoal& goal) {
  TrajectoryRequest request;
  request.joint_names = goal.trajectory.joint_names;
  for (const auto& point : goal.trajectory.points) {
    request.points.push_back(
        {point.time_from_start.toSec(), point.positions, point.velocities, point.accelerations});
  }
  request.path_tolerance = read(goal.path_tolerance);
  request.goal_tolerance = read(goal.goal_tolerance);
  request.goal_time_tolerance = goal.goal_time_tolerance.toSec();
  const ros::Time& stamp = goal.trajectory.header.stamp;
  if (!stamp.isZero()) request.age = 1e-9 * static_cast<double>(ageOf(stamp));
  return request;
}

Result resultOf(TrajectoryError error, const std::string& sentence) {
  Result result;
  result.error_code = static_cast<int>(error);
  result.error_string = sentence;
  return result;
}

void write(const JointPoint& from, std::size_t joints, trajectory_msgs::JointTrajectoryPoint& to) {
  to.positions.assign(from.position.data(), from.position.data() + joints);
  to.velocities.assign(from.velocity.data(), from.velocity.data() + joints);
  to.time_from_start.fromSec(from.time);
}

}  // namespace

/// Action `<id>/follow_joint_trajectory`; topic `<id>/state` at 50 Hz while the arm follows. A goal
/// makes its controller active if no other motion is running. A newer goal replaces the older one.
///
/// A goal with a stamp in the future is accepted and waits; the running motion continues. A cancel
/// by its client and a newer goal end the wait. The goal does not begin after a cancel of a motion,
/// a stop of the robot or a switch to another controller.
class JointTrajectoryRos : public MotionControllerRos {
 public:
  void attach(MotionController& controller, const ros::NodeHandle& node,
              const RosContext& context) override {
    controller_ = &dynamic_cast<JointTrajectory&>(controller);
    node_ = node;
    queue_ = node.getCallbackQueue();
    take_arm_ = context.take_arm;
    cancel_ = context.cancel;
    state_ = node_.advertise<control_msgs::JointTrajectoryControllerState>("state", 10);
    server_ = std::make_unique<Server>(
        node_, "follow_joint_trajectory", [this](Server::GoalHandle goal) { onGoal(goal); },
        [this](Server::GoalHandle goal) { onCancel(goal); });
    server_->start();
  }

  ~JointTrajectoryRos() override {
    if (queue_ != nullptr) queue_->removeByID(callbackId());  // waits for one that runs
    server_.reset();
  }

  void spinOnce() override {
    const std::lock_guard<std::mutex> lock(goals_mutex_);
    for (EndedMotion end; controller_->readEnd(end);) ends_.push_back(end);
    settle();
    if (waiting_ && !waiting_->called && steadyNow() >= waiting_->due_ns) {
      waiting_->called = true;
      // Not here: it may wait for the control cycle.
      queue_->addCallback(boost::make_shared<Due>(*this), callbackId());
    }
    if (++calls_ % 4 == 0) publishState();
  }

 private:
  struct Waiting {
    Server::GoalHandle goal;
    WaitingTrajectory trajectory;
    std::int64_t due_ns = 0;  // steady clock
    bool called = false;
  };

  /// Begins the waiting trajectory in a thread of the services.
  class Due : public ros::CallbackInterface {
   public:
    explicit Due(JointTrajectoryRos& side) : side_(side) {}
    CallResult call() override {
      side_.onDue();
      return Success;
    }

   private:
    JointTrajectoryRos& side_;
  };

  std::uint64_t callbackId() const { return reinterpret_cast<std::uint64_t>(this); }

  /// May wait for the control cycle.
  void onGoal(Server::GoalHandle goal) {
    const std::lock_guard<std::mutex> order(order_);
    const std::size_t size = ros::serialization::serializationLength(*goal.getGoal());
    if (size > kLargest) {
      return refuse(goal, refusal(Answer::refusal(
                              ReasonCode::OutOfRange,
                              "the goal has " + std::to_string(size) + " bytes; expected at most " +
                                  std::to_string(kLargest) + "; send fewer points")));
    }
    Waiting waiting;
    waiting.goal = goal;
    waiting.trajectory.request = read(*goal.getGoal());
    TrajectoryAnswer answer = controller_->check(waiting.trajectory.request);
    if (answer.success) {
      const Answer taken = take_arm_();
      if (!taken.success) {
        answer = refusal(taken);
      } else if (waiting.trajectory.request.age < 0.0) {
        answer = controller_->accept(waiting.trajectory);
        if (answer.success) return wait(waiting);
      } else {
        answer = controller_->follow(waiting.trajectory.request);
      }
    }
    if (!answer.success) return refuse(goal, answer);
    goal.setAccepted();
    endWait("a newer trajectory took its place");
    run(goal, answer.id);
  }

  static TrajectoryAnswer refusal(const Answer& why) {
    TrajectoryAnswer answer;
    static_cast<Answer&>(answer) = why;
    answer.error = TrajectoryError::InvalidGoal;
    return answer;
  }

  static void refuse(Server::GoalHandle& goal, const TrajectoryAnswer& answer) {
    ROS_WARN("follow_joint_trajectory refused: %s", answer.message.c_str());
    goal.setRejected(resultOf(answer.error, answer.message), answer.message);
  }

  void wait(Waiting& waiting) {
    const double time = -waiting.trajectory.request.age;
    waiting.goal.setAccepted();
    endWait("a newer trajectory took its place");
    ROS_INFO("the trajectory begins in %.2f s, by its stamp", time);
    const std::lock_guard<std::mutex> lock(goals_mutex_);
    waiting.due_ns = steadyNow() + static_cast<std::int64_t>(1e9 * time);
    waiting_ = waiting;
    if (waiting.goal.getGoalStatus().status == actionlib_msgs::GoalStatus::PREEMPTING)
      cancelWait("the client of the trajectory cancelled it");
  }

  void onDue() {
    const std::lock_guard<std::mutex> order(order_);
    std::optional<Waiting> begins;
    {
      const std::lock_guard<std::mutex> lock(goals_mutex_);
      // A newer one may have taken its place.
      if (!waiting_ || !waiting_->called) return;
      begins.swap(waiting_);
    }
    const TrajectoryAnswer answer = controller_->follow(begins->trajectory);
    if (answer.success) return run(begins->goal, answer.id);
    ROS_WARN("the trajectory that waited does not begin: %s", answer.message.c_str());
    const Result result = resultOf(answer.error, answer.message);
    if (answer.code == ReasonCode::Cancelled)
      return begins->goal.setCanceled(result, answer.message);
    begins->goal.setAborted(result, answer.message);
  }

  void endWait(const std::string& why) {
    const std::lock_guard<std::mutex> lock(goals_mutex_);
    cancelWait(why);
  }

  /// With goals_mutex_.
  void cancelWait(const std::string& why) {
    if (!waiting_) return;
    waiting_->goal.setCanceled(resultOf(TrajectoryError::None, why), why);
    waiting_.reset();
  }

  void run(Server::GoalHandle goal, int id) {
    const std::lock_guard<std::mutex> lock(goals_mutex_);
    goals_.emplace(id, goal);
    if (goal.getGoalStatus().status == actionlib_msgs::GoalStatus::PREEMPTING) cancelMotion();
    settle();
  }

  void onCancel(Server::GoalHandle goal) {
    const std::lock_guard<std::mutex> lock(goals_mutex_);
    if (waiting_ && waiting_->goal == goal)
      return cancelWait("the client of the trajectory cancelled it");
    for (const auto& [id, other] : goals_) {
      if (other == goal) return cancelMotion();
    }
  }

  void cancelMotion() { cancel_("the client of the trajectory cancelled it"); }

  /// Ends the goals whose motions have ended. A motion may end before its goal is stored.
  void settle() {
    for (auto end = ends_.begin(); end != ends_.end();) {
      const auto goal = goals_.find(end->id);
      if (goal == goals_.end()) {
        ++end;
        continue;
      }
      finish(goal->second, *end);
      goals_.erase(goal);
      end = ends_.erase(end);
    }
  }

  static void finish(Server::GoalHandle& goal, const EndedMotion& end) {
    const std::string why = end.reason.str();
    const Result result = resultOf(JointTrajectory::errorOf(end), why);
    const ReasonCode code = end.reason.code();
    if (end.executed) return goal.setSucceeded(result);
    ROS_LOG(endLevel(end.reason), ROSCONSOLE_DEFAULT_NAME, "the trajectory was not executed: %s",
            why.c_str());
    if (code == ReasonCode::Cancelled || code == ReasonCode::Superseded)
      return goal.setCanceled(result, why);
    goal.setAborted(result, why);
  }

  void publishState() {
    TrajectoryProgress now;
    if (!controller_->readProgress(now) || !now.moving) return;
    const std::size_t joints = controller_->jointNames().size();
    JointPoint error = now.desired;
    error.position -= now.actual.position;
    error.velocity -= now.actual.velocity;
    control_msgs::FollowJointTrajectoryFeedback feedback;
    feedback.header.stamp = toRos(now.stamp_ns);
    feedback.joint_names = controller_->jointNames();
    write(now.desired, joints, feedback.desired);
    write(now.actual, joints, feedback.actual);
    write(error, joints, feedback.error);
    control_msgs::JointTrajectoryControllerState state;
    state.header = feedback.header;
    state.joint_names = feedback.joint_names;
    state.desired = feedback.desired;
    state.actual = feedback.actual;
    state.error = feedback.error;
    state_.publish(state);
    const auto goal = goals_.find(now.id);
    if (goal != goals_.end()) goal->second.publishFeedback(feedback);
  }

  JointTrajectory* controller_ = nullptr;
  ros::NodeHandle node_;
  std::function<Answer()> take_arm_;
  std::function<void(const std::string&)> cancel_;
  ros::Publisher state_;
  std::mutex order_;  // goals are processed one after another
  std::mutex goals_mutex_;
  std::map<int, Server::GoalHandle> goals_;  // running goals by the id of their motion
  std::vector<EndedMotion> ends_;            // of motions whose goal is not stored yet
  std::optional<Waiting> waiting_;           // begins at the time of its stamp
  ros::CallbackQueueInterface* queue_ = nullptr;
  std::uint64_t calls_ = 0;
  std::unique_ptr<Server> server_;  // ends first: its callbacks use the rest
};

}  // namespace coglab_controllers

COGLAB_REGISTER_MOTION_CONTROLLER_WITH_ROS("coglab/JointTrajectory",
                                           coglab_controllers::JointTrajectory,
                                           coglab_controllers::JointTrajectoryRos)
