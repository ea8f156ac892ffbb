/// @file
/// The topic target_joint_states: which publisher may move the arm, and which messages are refused.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include <ros/ros.h>
#include <sensor_msgs/JointState.h>

#include "lwr_fri_bridge/bridge/bridge.hpp"
#include "lwr_fri_bridge/requests/target_command.hpp"

namespace lwr_fri_bridge {

/// Checks each message. Sends valid ones to the bridge; counts and logs the others. Callbacks run
/// in one thread at a time. Any thread may read the counts.
class TargetTopic {
 public:
  /// @param one_process true: ignore the messages of this process's own control thread
  TargetTopic(Bridge& bridge, bool one_process) : bridge_(bridge), one_process_(one_process) {}

  /// Subscribes in the namespace of `nh`.
  void start(ros::NodeHandle& nh);

  /// Ignores all messages from now on, because the node ends. Does not contact the ROS master.
  void close() { closing_ = true; }

  /// Unsubscribes, which contacts the ROS master.
  void stop() { subscriber_.shutdown(); }

  /// Sets whether a controller of this process moves the arm. Messages are then refused.
  void setControllerActive(bool active) { controller_active_ = active; }

  /// Number of refused messages by reason.
  struct Refused {
    std::uint64_t invalid = 0;            ///< not seven finite velocities of the arm's joints
    std::uint64_t stamp = 0;              ///< no stamp, too old, or from the future
    std::uint64_t old_permission = 0;     ///< made before the current motion epoch
    std::uint64_t controller_active = 0;  ///< a controller of this process is active
    std::uint64_t second_publisher = 0;   ///< another publisher moves the arm
    std::uint64_t not_allowed = 0;        ///< motion is not allowed
    std::uint64_t total() const {
      return invalid + stamp + old_permission + controller_active + second_publisher + not_allowed;
    }
  };
  Refused refused() const;

 private:
  void onMessage(const ros::MessageEvent<const sensor_msgs::JointState>& event);
  bool mayMove(const std::string& publisher);
  void countAndSay(const TargetVerdict& verdict, const std::string& publisher);

  Bridge& bridge_;
  const bool one_process_;
  ros::Subscriber subscriber_;
  std::atomic<bool> closing_{false}, controller_active_{false};
  std::atomic<std::uint64_t> invalid_{0}, stamp_{0}, old_permission_{0}, active_{0}, second_{0},
      not_allowed_{0};
  std::string publisher_;         // publisher of the last followed velocity
  std::int64_t followed_ns_ = 0;  // its time; both only in the callback
};

}  // namespace lwr_fri_bridge
