/// @file
/// Topic predicted_path of a motion controller: the future path of the arm, for web pages and rviz.
#pragma once

#include <cstdint>
#include <string>

#include <geometry_msgs/Pose.h>
#include <ros/node_handle.h>

#include "coglab_controllers/motion/predicted_path.hpp"
#include "coglab_msgs/PredictedPath.h"

namespace coglab_controllers {

/// Returns the message of a path whose poses are in `frame`.
coglab_msgs::PredictedPath toMessage(const PredictedPath& path, const std::string& frame);

void write(const Pose& pose, geometry_msgs::Pose& message);

/// Publishes predicted_path. Publisher thread only.
class PathTopic {
 public:
  /// @param frame of the poses
  void attach(ros::NodeHandle& node, const std::string& frame);

  /// Called at 200 Hz. While the topic has a subscriber, it publishes the path when a motion begins
  /// and every 0.2 s while it runs, for the goal at that time. After the end it publishes a message
  /// without poses. Each roll-out takes about 1 ms of this thread and no time of the control cycle.
  template <typename Controller>
  void spin(Controller& controller, bool moving) {
    if (due(moving)) controller.askPath();
    PredictedPath path;
    if (controller.readPath(path) && moving) publish(path);
  }

 private:
  bool due(bool moving);
  void publish(const PredictedPath& path);

  ros::Publisher publisher_;
  std::string frame_;
  std::uint64_t calls_ = 0;
  bool shown_ = false;  // a path was published, its end was not
};

}  // namespace coglab_controllers
