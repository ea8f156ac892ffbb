/// @file
/// The topic on which a motion controller publishes its progress.
#pragma once

#include <cstdint>

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include "coglab_controllers/motion/motion_runner.hpp"

namespace coglab_controllers {

/// Latched topic `<id>/motion_feedback`: 50 Hz while a motion runs and 5 Hz otherwise. Every change
/// and every end of a motion is published at once. One thread, after attach().
class MotionFeedbackTopic {
 public:
  void attach(ros::NodeHandle& node);

  /// Publishes what is due; 200 Hz. @tparam Controller a MotionRunner with readProgress()
  template <typename Controller>
  void spin(Controller& controller) {
    const MotionProgress before = progress_;
    const bool fresh = controller.readProgress(progress_);
    // Also motions that ended between two calls.
    for (EndedMotion end; controller.readEnd(end);) publishEnd(end);
    publishProgress(before, fresh);
  }

 private:
  void publishEnd(const EndedMotion& end);
  void publishProgress(const MotionProgress& before, bool fresh);
  void publish(const MotionProgress& progress);

  ros::Publisher topic_;
  MotionProgress progress_;
  std::uint64_t calls_ = 0, published_ = 0;
};

}  // namespace coglab_controllers
