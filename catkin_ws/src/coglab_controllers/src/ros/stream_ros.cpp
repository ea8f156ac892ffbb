// ROS side of the streams: a topic for the commands, start_motion to open, motion_feedback.
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <ros/ros.h>
#include <std_msgs/Float64MultiArray.h>

#include "coglab_controllers/manager/plugin_registry.hpp"
#include "coglab_controllers/plugins/stream_controller.hpp"
#include "coglab_controllers/ros/motion_controller_ros.hpp"
#include "coglab_controllers/ros/motion_feedback_topic.hpp"
#include "coglab_controllers/ros/sentence_throttle.hpp"
#include "coglab_msgs/StartMotion.h"
#include "coglab_rt/ros/parameter.hpp"

namespace coglab_controllers {

namespace {
constexpr double kOldestFrame = 1.0;  // s, largest age of a command's frame
}

/// Service `<id>/start_motion` opens the stream, and activates the controller if no other motion is
/// running; `<id>/cancel` closes it. One publisher at a time: it keeps the stream until it pauses
/// for `command_timeout`.
class StreamRos : public MotionControllerRos {
 public:
  ~StreamRos() override {
    service_.shutdown();
    commands_.shutdown();
  }

  void attach(MotionController& controller, const ros::NodeHandle& node,
              const RosContext& context) override {
    controller_ = &dynamic_cast<StreamController&>(controller);
    node_ = node;
    take_arm_ = context.take_arm;
    frames_ = std::make_unique<TfGoalSource>(*context.tf, *context.listener);
    tool_frame_ = coglab_rt::readNearest<std::string>(node_, "tool_link", "ih2_palm", "a frame");
    feedback_.attach(node_);
    commands_ = subscribe(node_);
    service_ = node_.advertiseService("start_motion", &StreamRos::onStart, this);
  }

  void spinOnce() override { feedback_.spin(*controller_); }

 protected:
  virtual ros::Subscriber subscribe(ros::NodeHandle& node) = 0;

  /// Subscribes to the newest command.
  template <typename Message, typename Side>
  ros::Subscriber subscribeTo(ros::NodeHandle& node, const char* topic,
                              void (Side::*receive)(const ros::MessageEvent<const Message>&)) {
    return node.subscribe(topic, 1, receive, static_cast<Side*>(this),
                          ros::TransportHints().tcpNoDelay());
  }

  /// Age of a command by its stamp, s; 0 without one.
  static double age(const ros::Time& stamp) {
    return stamp.isZero() ? 0.0 : 1e-9 * static_cast<double>(ageOf(stamp));
  }

  bool isTool(const std::string& frame) const { return frame == tool_frame_; }

  /// Pose of a frame in the base frame. On false, `why` contains the error.
  bool inBase(const std::string& frame, Pose& pose, std::string& why) {
    if (frame.empty() || frame == controller_->baseFrame()) return true;
    GoalObservation seen;
    if (!frames_->lookup(controller_->baseFrame(), frame, seen, why)) {
      why = "frame_id '" + frame + "' is not known: " + why + "; expected '" +
            controller_->baseFrame() + "', '" + tool_frame_ + "' or a frame of tf";
      return false;
    }
    const double old = 1e-9 * static_cast<double>(steadyNow() - seen.stamp_ns);
    if (old > kOldestFrame) {
      why = "frame_id '" + frame + "' was last seen " + std::to_string(old) + " s ago";
      return false;
    }
    pose = {seen.position, seen.orientation};
    return true;
  }

  void send(const std::string& publisher, const StreamMessage& message) {
    const std::int64_t now = steadyNow();
    const double pause = 1e-9 * static_cast<double>(now - sent_ns_);
    if (publisher != publisher_ && sent_ns_ != 0 && pause < controller_->commandTimeout()) {
      return refuse(publisher, publisher_ + " sends commands already; end that one first");
    }
    const Answer answer = controller_->send(message);
    if (!answer.success) return refuse(publisher, answer.message);
    publisher_ = publisher;
    sent_ns_ = now;
  }

  void refuse(const std::string& publisher, const std::string& why) {
    if (!warned_.may(publisher + why, steadyNow())) return;
    ROS_WARN("%s: command of %s refused: %s", controller_->id().c_str(), publisher.c_str(),
             why.c_str());
  }

 private:
  bool onStart(coglab_msgs::StartMotion::Request& request,
               coglab_msgs::StartMotion::Response& response) {
    MotionAnswer answer;
    if (!request.names.empty()) {
      static_cast<Answer&>(answer) = Answer::refusal(
          ReasonCode::UnknownName, "a stream has no arguments; call start_motion without names");
    } else {
      const Answer taken = take_arm_();
      answer = taken.success ? controller_->open() : MotionAnswer::rejected(taken);
    }
    response.status = answer.status;
    response.motion_id = answer.id;
    response.success = answer.success;
    response.reason_code = answer.number();
    response.message = answer.message;
    if (!answer.success) ROS_WARN("start_motion rejected: %s", answer.message.c_str());
    return true;
  }

  StreamController* controller_ = nullptr;
  ros::NodeHandle node_;
  std::function<Answer()> take_arm_;
  std::unique_ptr<TfGoalSource> frames_;
  std::string tool_frame_;
  MotionFeedbackTopic feedback_;
  // the subscriber's callbacks, which come one after another
  std::string publisher_;
  std::int64_t sent_ns_ = 0;
  SentenceThrottle warned_{2.0};
  ros::Subscriber commands_;
  ros::ServiceServer service_;
};

/// Topic `<id>/twist`: velocity of the palm's origin (m/s) and of its turning (rad/s), in the axes
/// of header.frame_id: the palm, the base (also if empty), or any frame of tf.
class TwistStreamRos : public StreamRos {
  ros::Subscriber subscribe(ros::NodeHandle& node) override {
    return subscribeTo(node, "twist", &TwistStreamRos::receive);
  }

  void receive(const ros::MessageEvent<const geometry_msgs::TwistStamped>& event) {
    const geometry_msgs::TwistStamped& message = *event.getMessage();
    const std::string& frame = message.header.frame_id;
    Vector3 linear(message.twist.linear.x, message.twist.linear.y, message.twist.linear.z);
    Vector3 angular(message.twist.angular.x, message.twist.angular.y, message.twist.angular.z);
    Pose axes;
    std::string why;
    if (!isTool(frame) && !inBase(frame, axes, why)) return refuse(event.getPublisherName(), why);
    linear = axes.orientation * linear;
    angular = axes.orientation * angular;
    send(event.getPublisherName(),
         {{linear.x(), linear.y(), linear.z(), angular.x(), angular.y(), angular.z()},
          age(message.header.stamp),
          isTool(frame)});
  }
};

/// Topic `<id>/pose`: pose of the palm (m, unit quaternion) in header.frame_id: the base (also if
/// empty) or any frame of tf.
class PoseStreamRos : public StreamRos {
  ros::Subscriber subscribe(ros::NodeHandle& node) override {
    return subscribeTo(node, "pose", &PoseStreamRos::receive);
  }

  void receive(const ros::MessageEvent<const geometry_msgs::PoseStamped>& event) {
    const geometry_msgs::PoseStamped& message = *event.getMessage();
    const auto& p = message.pose.position;
    const auto& q = message.pose.orientation;
    Pose frame;
    std::string why;
    if (!inBase(message.header.frame_id, frame, why)) return refuse(event.getPublisherName(), why);
    const Vector3 position = frame.position + frame.orientation * Vector3(p.x, p.y, p.z);
    const Quaternion turn = frame.orientation * Quaternion(q.w, q.x, q.y, q.z);
    send(event.getPublisherName(),
         {{position.x(), position.y(), position.z(), turn.x(), turn.y(), turn.z(), turn.w()},
          age(message.header.stamp),
          false});
  }
};

/// Topic `<id>/joint_velocity`: one velocity (rad/s) for each joint in wire order. The message has
/// no stamp: it counts from its arrival.
class JointVelocityStreamRos : public StreamRos {
  ros::Subscriber subscribe(ros::NodeHandle& node) override {
    return subscribeTo(node, "joint_velocity", &JointVelocityStreamRos::receive);
  }

  void receive(const ros::MessageEvent<const std_msgs::Float64MultiArray>& event) {
    send(event.getPublisherName(), {event.getMessage()->data, 0.0, false});
  }
};

namespace {

template <typename Controller, typename Side>
constexpr MotionMaker makerOf() {
  MotionMaker maker;
  maker.controller = []() -> MotionController* { return new Controller(); };
  maker.ros = []() -> MotionControllerRos* { return new Side(); };
  return maker;
}

const MotionRegistration twist_stream("coglab/TwistStream", makerOf<TwistStream, TwistStreamRos>());
const MotionRegistration pose_stream("coglab/PoseStream", makerOf<PoseStream, PoseStreamRos>());
const MotionRegistration joint_velocity_stream(
    "coglab/JointVelocityStream", makerOf<JointVelocityStream, JointVelocityStreamRos>());

}  // namespace

}  // namespace coglab_controllers
