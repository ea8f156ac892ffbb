/// @file
/// The ideal arm as a back end of robot_node, with the ROS names of the arm's interface.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>

#include <coglab_msgs/LwrCommand.h>
#include <coglab_msgs/LwrState.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/String.h>

#include "coglab_controllers/ideal/ideal_arm.hpp"
#include "coglab_rt/real_time.hpp"

namespace coglab_controllers {

/// Reads `limits_file`, `limits_profile`, `ideal_period` (s), `command_timeout` (s) and
/// `start_position` (7 rad). @throws std::exception naming parameter, value and range
IdealArmConfig readIdealArmConfig(const ros::NodeHandle& node);

/// Publishes `joint_states` (at joint_states_rate or the arm's rate, the lower one) and `state`
/// (latched, on change); subscribes to `ros_events`; serves `command`. Only the controllers of this
/// process move the arm: target_joint_states only displays their velocities.
///
/// It has two threads besides those of ROS: the arm's (named `ideal_arm`) and a publisher.
class IdealArmRos : public coglab_rt::ArmPort {
 public:
  /// @param node namespace of the arm's interface (…/lwr)
  explicit IdealArmRos(const ros::NodeHandle& node);
  ~IdealArmRos() override;
  IdealArmRos(const IdealArmRos&) = delete;
  IdealArmRos& operator=(const IdealArmRos&) = delete;

  coglab_rt::ArmMailboxes& mailboxes() override { return arm_.mailboxes(); }
  void start(Wake wake) override;
  /// Does nothing, because no other source moves this arm.
  void setControllerActive(bool) override {}
  void shutdown() override;
  void unregister() override;
  int highestPriority() override;

 private:
  void armLoop();
  void publishLoop();
  void publishState(const IdealArmView& view);
  coglab_rt::Answer request(const std::string& event);
  void onEvent(const std_msgs::String& message);
  bool onCommand(coglab_msgs::LwrCommand::Request& request,
                 coglab_msgs::LwrCommand::Response& response);

  ros::NodeHandle node_;
  IdealArm arm_;
  Wake wake_;
  int priority_ = 0;
  double publish_period_ = 0.005;  // s
  ros::CallbackQueue queue_;
  ros::Publisher joint_states_, state_;
  ros::Subscriber events_;
  ros::ServiceServer command_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
  coglab_rt::BoundedThread thread_;
  std::thread publisher_;
  std::atomic<bool> arm_ends_{false}, publisher_ends_{false}, closing_{false};
  std::atomic<bool> real_time_{false}, scheduled_{false};  // SCHED_FIFO was granted; that is known
  bool running_ = false;
  sensor_msgs::JointState joint_message_;  // publisher thread
  coglab_msgs::LwrState state_message_;    // publisher thread
};

}  // namespace coglab_controllers
