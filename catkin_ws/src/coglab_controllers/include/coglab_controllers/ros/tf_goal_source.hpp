/// @file
/// Frames from tf2.
#pragma once

#include <string>

#include <tf2_ros/buffer.h>

#include "coglab_controllers/plugins/goal_source.hpp"

namespace coglab_controllers {

/// The newest transform of a tf2 buffer. Any thread but the control thread.
class TfGoalSource : public GoalSource {
 public:
  explicit TfGoalSource(tf2_ros::Buffer& buffer) : buffer_(buffer) {}
  bool lookup(const std::string& reference, const std::string& frame, GoalObservation& observation,
              std::string& why) override;

 private:
  tf2_ros::Buffer& buffer_;
};

}  // namespace coglab_controllers
