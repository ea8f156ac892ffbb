// ROS side of the DMP plug-in: services and topics of D4.10 Table 4, and the registration of both
// halves.
#include <memory>
#include <string>

#include <geometry_msgs/TransformStamped.h>
#include <ros/ros.h>
#include <tf2_ros/transform_broadcaster.h>

#include "coglab_controllers/manager/plugin_registry.hpp"
#include "coglab_controllers/plugins/dmp_controller.hpp"
#include "coglab_controllers/ros/motion_controller_ros.hpp"
#include "coglab_controllers/ros/path_topic.hpp"
#include "coglab_controllers/ros/sentence_throttle.hpp"
#include "coglab_controllers/ros/tf_listener.hpp"
#include "coglab_msgs/DmpFeedback.h"
#include "coglab_msgs/DmpGoal.h"
#include "coglab_msgs/ExecuteDmp.h"
#include "coglab_msgs/IkDebug.h"
#include "coglab_msgs/LoadDmps.h"
#include "coglab_msgs/PredictDmp.h"
#include "coglab_msgs/SwitchDmp.h"

namespace coglab_controllers {

namespace {

template <typename Point>
Vector3 toVector(const Point& point) {
  return Vector3(point.x, point.y, point.z);
}

template <typename Point>
void write(const Vector3& v, Point& point) {
  point.x = v.x();
  point.y = v.y();
  point.z = v.z();
}

/// Common fields of execute_dmp, predict_dmp and switch_dmp.
template <typename Request>
DmpRequest readRequest(const Request& request) {
  DmpRequest result;
  result.primitive_id = request.primitive_id;
  result.dmp_ratio = request.dmp_ratio;
  result.goal_offset = toVector(request.goal_offset);
  result.orientation_control = request.orientation_control;
  const auto& q = request.target_orientation;
  result.target_orientation = Eigen::Vector4d(q.x, q.y, q.z, q.w);
  return result;
}

/// All fields of execute_dmp or predict_dmp (the same ones).
template <typename Request>
DmpRequest readWhole(const Request& request) {
  DmpRequest result = readRequest(request);
  result.initial_state = request.initial_state;
  result.initial_position = toVector(request.initial_position);
  result.initial_velocity = toVector(request.initial_velocity);
  result.goal_frame = request.goal_frame;
  result.goal_approach = toVector(request.goal_approach);
  result.arrival_speed = request.arrival_speed;
  return result;
}

}  // namespace

class DmpControllerRos : public MotionControllerRos {
 public:
  ~DmpControllerRos() override {
    for (ros::ServiceServer& service : services_) service.shutdown();
    goal_.shutdown();
    if (controller_ != nullptr) controller_->setGoalSource(nullptr);
  }

  void attach(MotionController& controller, const ros::NodeHandle& node,
              const RosContext& context) override {
    controller_ = &dynamic_cast<DmpController&>(controller);
    node_ = node;
    source_ = std::make_unique<TfGoalSource>(*context.tf, *context.listener);
    controller_->setGoalSource(source_.get());
    feedback_ = node_.advertise<coglab_msgs::DmpFeedback>("feedback", 10, true);
    debug_ = node_.advertise<coglab_msgs::IkDebug>("ik_debug", 200);
    goal_ = node_.subscribe("dmp_goal", 1, &DmpControllerRos::onGoal, this);
    services_[0] = node_.advertiseService("load_dmps", &DmpControllerRos::onLoad, this);
    services_[1] = node_.advertiseService("execute_dmp", &DmpControllerRos::onExecute, this);
    services_[2] = node_.advertiseService("switch_dmp", &DmpControllerRos::onSwitch, this);
    services_[3] = node_.advertiseService("predict_dmp", &DmpControllerRos::onPredict, this);
    path_.attach(node_, controller_->dmpFrame());
    bool debug = false;  // only the first reading may contact the master
    node_.getParamCached("enable_ik_debug", debug);
  }

  void pollGoal() override { controller_->pollGoal(); }

  void spinOnce() override {
    publishDebug();
    publishFeedback();
    path_.spin(*controller_, moving());
    // Once a second, because the parameter may change at run time. The master reports a change.
    if (++calls_ % 200 == 0) {
      bool debug = controller_->ikDebug();
      if (node_.getParamCached("enable_ik_debug", debug)) controller_->setIkDebug(debug);
    }
  }

 private:
  using LoadDmps = coglab_msgs::LoadDmps;
  using ExecuteDmp = coglab_msgs::ExecuteDmp;
  using PredictDmp = coglab_msgs::PredictDmp;
  using SwitchDmp = coglab_msgs::SwitchDmp;

  bool onLoad(LoadDmps::Request& request, LoadDmps::Response& response) {
    int loaded = 0;
    const Answer answer = controller_->loadDmps(request.filename, loaded);
    response.num_loaded = static_cast<std::int16_t>(loaded);
    response.success = answer.success;
    response.reason_code = answer.number();
    response.message = answer.message;
    if (!answer.success) ROS_WARN("load_dmps refused: %s", answer.message.c_str());
    return true;
  }

  bool onExecute(ExecuteDmp::Request& request, ExecuteDmp::Response& response) {
    DmpRequest asked = readWhole(request);
    asked.goal_limits.region_low = toVector(request.goal_region_low);
    asked.goal_limits.region_high = toVector(request.goal_region_high);
    asked.goal_limits.retreat = request.goal_retreat;
    asked.goal_limits.drop = request.goal_drop;
    return reply("execute_dmp", controller_->execute(asked), response);
  }

  /// Predictions may be requested often, so refusals are not logged.
  bool onPredict(PredictDmp::Request& request, PredictDmp::Response& response) {
    PredictedPath path;
    const Answer answer = controller_->predict(readWhole(request), path);
    if (answer.success) response.path = toMessage(path, controller_->dmpFrame());
    response.success = answer.success;
    response.reason_code = answer.number();
    response.message = answer.message;
    return true;
  }

  bool onSwitch(SwitchDmp::Request& request, SwitchDmp::Response& response) {
    return reply("switch_dmp", controller_->switchDmp(readRequest(request)), response);
  }

  template <typename Response>
  bool reply(const char* service, const Answer& answer, Response& response) {
    response.success = answer.success;
    response.reason_code = answer.number();
    response.message = answer.message;
    if (!answer.success) ROS_WARN("%s refused: %s", service, answer.message.c_str());
    return true;
  }

  void onGoal(const coglab_msgs::DmpGoal& goal) {
    const ros::Time stamp = goal.header.stamp.isZero() ? ros::Time::now() : goal.header.stamp;
    const Answer answer = controller_->setGoal(goal.header.frame_id, toVector(goal.goal),
                                               toSteady(stamp), nanoseconds(stamp));
    if (answer.success) {
      if (!answer.message.empty()) ROS_INFO_THROTTLE(10.0, "%s", answer.message.c_str());
      return;
    }
    ++goals_refused_;
    if (!warned_.may(answer.message, steadyNow())) return;
    ROS_WARN("%s; %llu refused so far", answer.message.c_str(),
             static_cast<unsigned long long>(goals_refused_));
  }

  void publishDebug() {
    IkDebugRecord record;
    while (controller_->readIkDebug(record)) {
      coglab_msgs::IkDebug message;
      message.header.stamp = toRos(record.stamp_ns);
      message.header.frame_id = controller_->baseFrame();
      message.phase = record.phase;
      write(record.goal, message.goal);
      write(record.set_point, message.set_point);
      write(record.velocity, message.set_point_velocity.linear);
      write(record.angular_velocity, message.set_point_velocity.angular);
      write(record.measured, message.measured);
      write(record.ik.position_error, message.position_error);
      write(record.ik.rotation_error, message.rotation_error);
      const auto copy = [](const JointVector& v) {
        return std::vector<double>(v.data(), v.data() + v.size());
      };
      message.joint_velocity_position = copy(record.ik.position_velocity);
      message.joint_velocity_rotation = copy(record.ik.rotation_velocity);
      message.smallest_singular_value_position = record.ik.smallest_singular_value_position;
      message.smallest_singular_value_rotation = record.ik.smallest_singular_value_rotation;
      message.rotation_rejected = record.ik.rotation_rejected;
      debug_.publish(message);
    }
  }

  bool moving() const {
    return progress_.state == MotionState::Running || progress_.state == MotionState::Holding;
  }

  void publishFeedback() {
    const MotionState before = progress_.state;
    const ReasonCode code = progress_.reason.code();
    if (!controller_->readProgress(progress_)) return;
    broadcastGoal();
    const bool changed = progress_.state != before || progress_.reason.code() != code;
    // 50 Hz while it moves, 5 Hz otherwise, and every change at once.
    if (!changed && calls_ - last_feedback_ < (moving() ? 4u : 40u)) return;
    last_feedback_ = calls_;
    coglab_msgs::DmpFeedback message;
    message.header.stamp = toRos(progress_.stamp_ns);
    message.header.frame_id = controller_->dmpFrame();
    message.primitive_id = progress_.primitive.str();
    message.state = nameOf(progress_.state);
    message.reason_code = progress_.reason.number();
    message.reason = progress_.reason.str();
    message.phase = progress_.phase;
    message.remaining_distance = progress_.remaining_distance;
    message.remaining_time = progress_.remaining_time;
    feedback_.publish(message);
    if (changed && progress_.state == MotionState::Aborted) {
      ROS_LOG(endLevel(progress_.reason), ROSCONSOLE_DEFAULT_NAME, "DMP motion '%s' ended: %s",
              message.primitive_id.c_str(), message.reason.c_str());
    } else if (changed && !message.reason.empty()) {
      ROS_INFO("DMP motion '%s': %s", message.primitive_id.c_str(), message.reason.c_str());
    }
  }

  /// Broadcasts the goal as a tf2 frame for rviz and recordings, at 33 Hz while a motion runs.
  void broadcastGoal() {
    const std::string& frame = controller_->goalTfFrame();
    if (!moving() || frame.empty() || progress_.stamp_ns == 0 || calls_ - last_goal_ < 6) return;
    last_goal_ = calls_;
    geometry_msgs::TransformStamped message;
    message.header.stamp = toRos(progress_.stamp_ns);
    message.header.frame_id = controller_->dmpFrame();
    message.child_frame_id = frame;
    geometry_msgs::Pose pose;
    write(progress_.goal, pose);
    message.transform.translation.x = pose.position.x;
    message.transform.translation.y = pose.position.y;
    message.transform.translation.z = pose.position.z;
    message.transform.rotation = pose.orientation;
    broadcaster_.sendTransform(message);
  }

  DmpController* controller_ = nullptr;
  ros::NodeHandle node_;
  tf2_ros::TransformBroadcaster broadcaster_;
  std::unique_ptr<TfGoalSource> source_;
  ros::Publisher feedback_, debug_;
  ros::Subscriber goal_;
  ros::ServiceServer services_[4];
  PathTopic path_;
  DmpProgress progress_;
  std::uint64_t calls_ = 0, last_feedback_ = 0, last_goal_ = 0;
  std::uint64_t goals_refused_ = 0;  // dmp_goal
  SentenceThrottle warned_{1.0};
};

}  // namespace coglab_controllers

COGLAB_REGISTER_MOTION_CONTROLLER_WITH_ROS("coglab/DmpController",
                                           coglab_controllers::DmpController,
                                           coglab_controllers::DmpControllerRos)
