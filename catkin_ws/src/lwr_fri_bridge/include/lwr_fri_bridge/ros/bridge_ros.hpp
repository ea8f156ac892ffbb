/// @file
/// ROS interface of the bridge (D4.10 Table 1): topics, service, diagnostics and parameters of the
/// namespace `/lwr`. Used by lwr_node, and by robot_node in one process with the controller
/// manager.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <semaphore.h>

#include <coglab_msgs/LwrCommand.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/String.h>

#include "lwr_fri_bridge/bridge/bridge.hpp"
#include "lwr_fri_bridge/bridge/fri_thread.hpp"

namespace lwr_fri_bridge {

class BridgeDiagnostics;
class TargetTopic;

/// Reads the parameters of the bridge from the namespace of `nh` (listed in config/lwr.yaml).
/// @throws std::exception with parameter, value and range, or with file, line and field of the
/// limits table.
BridgeConfig readBridgeConfig(const ros::NodeHandle& nh);
FriThreadOptions readFriThreadOptions(const ros::NodeHandle& nh);

/// Publishes joint_states, external_torques, tool_wrench (all at the lower of joint_states_rate and
/// the FRI rate) and state (latched, on change). Subscribes to target_joint_states and ros_events.
/// Provides the service command. It has its own callback queue and threads, so that a long start
/// does not delay a hold.
class BridgeRos : public coglab_rt::ArmPort {
 public:
  /// Reads the parameters under `nh` (normally ros::NodeHandle("lwr")).
  /// @param one_process true: a control thread of this process writes to mailboxes(), and
  /// target_joint_states is accepted only while no controller is active (setControllerActive).
  /// false: target_joint_states is the only source.
  /// @throws std::exception as readBridgeConfig().
  BridgeRos(const ros::NodeHandle& nh, bool one_process);
  ~BridgeRos() override;
  BridgeRos(const BridgeRos&) = delete;
  BridgeRos& operator=(const BridgeRos&) = delete;

  /// Binds the socket, sets the parameter fri_port_bound and starts all threads. `wake` is called
  /// in the FRI thread after each answer (true) and on idle ticks without datagrams (false). It may
  /// be empty. @throws std::runtime_error if the socket cannot be bound, std::exception with a
  /// parameter that is out of range.
  void start(Wake wake) override;

  /// Brakes and requests monitor mode. Keeps answering until monitor mode or its time limit is
  /// reached, then ends all threads. Call it on SIGINT, SIGTERM and at the end of main. It works
  /// without a roscore and can be called twice.
  void shutdown() override;
  /// Unregisters from the ROS master after shutdown(), and waits for it; see endProcessWithin().
  void unregister() override;

  Bridge& bridge() { return bridge_; }
  ArmMailboxes& mailboxes() override { return bridge_.mailboxes(); }
  /// Highest priority for other threads, below the FRI thread's. 0: none, if the FRI thread has no
  /// real-time priority.
  int highestPriority() override;

  /// Selects the velocities of the control thread (true) or of target_joint_states (false). Only in
  /// one process.
  void setControllerActive(bool active) override;

 private:
  friend class BridgeDiagnostics;

  void startThreads();
  void endThreads();
  void onEvent(const std_msgs::String& message);
  bool onCommand(coglab_msgs::LwrCommand::Request& request,
                 coglab_msgs::LwrCommand::Response& response);
  void publishLoop();
  void publishSample(const Snapshot& snapshot);
  void restartQuietly(const Snapshot& now);
  void publishStates();
  void publishState(const StateView& view);
  void reportOutcomes();

  ros::NodeHandle nh_;
  const bool one_process_;
  Wake wake_;  // FRI thread, from start() on
  ros::CallbackQueue queue_;
  Bridge bridge_;
  FriThread fri_thread_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
  std::unique_ptr<BridgeDiagnostics> diagnostics_;
  ros::Publisher joint_states_, external_torques_, tool_wrench_, state_, fri_latency_;
  std::int64_t latency_published_ns_ = 0;  // stamp of the sample with the last published latency
  StateView newest_state_;
  std::int64_t state_published_ns_ = 0;  // time of its last publication
  std::unique_ptr<TargetTopic> target_;
  ros::Subscriber events_;
  ros::ServiceServer command_;
  ros::SteadyTimer diagnostics_timer_;
  BoundedThread publisher_;
  sem_t new_sample_;
  std::int64_t publish_period_ns_ = 5'000'000;
  std::int64_t last_post_ns_ = 0;  // FRI thread
  std::int64_t started_ns_ = 0;
  std::uint64_t published_sequence_ = 0;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> closing_{false};  // the node ends: no more requests to the arm
  bool started_ = false;
  bool restarts_quietly_ = true;
  QuietRestart quiet_restart_;  // publisher thread
  std::mutex tickets_mutex_;
  std::vector<std::uint32_t> tickets_;  // of ros_events; their outcomes are logged
  sensor_msgs::JointState joint_message_, torque_message_;
  geometry_msgs::WrenchStamped wrench_message_;
};

}  // namespace lwr_fri_bridge
