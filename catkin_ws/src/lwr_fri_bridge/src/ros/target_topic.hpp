/// @file
/// The topic target_joint_states: who may move the arm by it, and what is refused and why.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include <ros/ros.h>
#include <sensor_msgs/JointState.h>

#include "lwr_fri_bridge/bridge/bridge.hpp"
#include "lwr_fri_bridge/requests/target_command.hpp"

namespace lwr_fri_bridge {

/// Judges each message, hands the good ones to the bridge, counts and names the others. Callbacks
/// run in one thread at a time; the counts may be read from any.
class TargetTopic {
 public:
  /// @param one_process  messages of this process' own control thread are no commands
  TargetTopic(Bridge& bridge, bool one_process) : bridge_(bridge), one_process_(one_process) {}

  /// Subscribes below `nh`.
  void start(ros::NodeHandle& nh);

  /// The node ends: what still comes moves nothing. Does not ask the ROS master.
  void close() { closing_ = true; }

  /// Unsubscribes, which asks the ROS master.
  void stop() { subscriber_.shutdown(); }

  /// Whether a controller of this process moves the arm; the topic counts only while none does.
  void setControllerActive(bool active) { controller_active_ = active; }

  /// Messages that were refused, by reason.
  struct Refused {
    std::uint64_t invalid = 0;            ///< not seven finite velocities of the arm's joints
    std::uint64_t stamp = 0;              ///< no stamp, too old, or from the future
    std::uint64_t old_permission = 0;     ///< made before motion was allowed as it is now
    std::uint64_t controller_active = 0;  ///< a controller of this process is active
    std::uint64_t second_publisher = 0;   ///< another publisher's velocities are followed
    std::uint64_t not_allowed = 0;        ///< motion is not allowed at present
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
  std::string publisher_;         // whose velocities were followed last
  std::int64_t followed_ns_ = 0;  // when; both only in the callback
};

}  // namespace lwr_fri_bridge
