/// @file
/// predicted_path of a motion controller: the way ahead of the arm, for pages and rviz.
#pragma once

#include <cstdint>
#include <string>

#include <geometry_msgs/Pose.h>
#include <ros/node_handle.h>

#include "coglab_controllers/motion/predicted_path.hpp"
#include "coglab_msgs/PredictedPath.h"

namespace coglab_controllers {

/// The message of a path whose poses are in `frame`.
coglab_msgs::PredictedPath toMessage(const PredictedPath& path, const std::string& frame);

void write(const Pose& pose, geometry_msgs::Pose& message);

/// The topic. Publisher thread alone.
class PathTopic {
 public:
  /// @param frame of the poses
  void attach(ros::NodeHandle& node, const std::string& frame);

  /// Called 200 times a second. While somebody listens: the path when a motion begins and every
  /// 0.2 s while it runs, its goal as it is then, and a message without poses when it has ended.
  /// Each roll-out costs about a millisecond of this thread, none of the control cycle.
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
  bool shown_ = false;  // a path that has not been ended
};

}  // namespace coglab_controllers
