/// @file
/// Frames from tf2.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>

#include <tf2/buffer_core.h>

#include "coglab_controllers/goal/goal_source.hpp"
#include "coglab_controllers/names.hpp"
#include "coglab_controllers/ros/tf_listener.hpp"
#include "coglab_rt/ros/ros_time.hpp"

namespace coglab_controllers {

/// The newest transform of a tf2 buffer. Any thread but the control thread.
class TfGoalSource : public GoalSource {
 public:
  /// @param listener what fills the buffer; both outlive the source
  /// @param steady the clock of the samples, ns
  TfGoalSource(const tf2::BufferCore& buffer, const TfListener& listener,
               std::function<std::int64_t()> steady = steadyNow)
      : buffer_(buffer), listener_(listener), steady_(std::move(steady)) {}
  bool lookup(const std::string& reference, const std::string& frame, GoalObservation& observation,
              std::string& why) override;
  double ahead(const std::string& frame) override { return listener_.ahead(frame); }

 private:
  const tf2::BufferCore& buffer_;
  const TfListener& listener_;
  std::function<std::int64_t()> steady_;
};

}  // namespace coglab_controllers
