/// @file
/// Copies valid transforms from /tf and /tf_static into a tf2 buffer, and reads goals from it.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include "coglab_controllers/goal/goal_input.hpp"
#include "coglab_controllers/names.hpp"

namespace coglab_controllers {

/// Replaces tf2_ros::TransformListener; it runs in a separate thread.
///
/// A tf2 buffer keeps a transform from the future as its newest one and interpolates towards it. If
/// it is further ahead than the length of the buffer, the buffer refuses all later transforms. So a
/// stamp more than kClockTolerance_ns ahead of this computer's clock is refused, and so are numbers
/// that are not finite. Refusals are counted and logged with the frame and its publisher.
class TfListener {
 public:
  /// @param buffer outlives the listener
  explicit TfListener(tf2::BufferCore& buffer) : buffer_(buffer) {}
  ~TfListener() { stop(); }

  void start();
  void stop();  ///< calls the ROS master once per topic
  /// Receives one message. Any thread; throws nothing.
  /// @param publisher name of the sending node
  void receive(const tf2_msgs::TFMessage& message, const std::string& publisher, bool is_static);

  /// Number of refused transforms.
  std::uint64_t refused() const { return refused_.load(std::memory_order_relaxed); }
  /// Number of backward steps of this computer's clock that were detected at messages.
  std::uint32_t clockSteps() const { return clock_steps_.load(std::memory_order_relaxed); }
  /// Time (s) by which the newest transform of this child frame was ahead of the clock, if it was
  /// refused for that; else 0.
  double ahead(const std::string& frame) const;

 private:
  using Event = ros::MessageEvent<const tf2_msgs::TFMessage>;
  bool acceptable(const geometry_msgs::TransformStamped& transform, const std::string& publisher,
                  bool is_static);
  void putStatic(const geometry_msgs::TransformStamped& transform, const std::string& publisher);
  void clearAfterAStepBack();

  tf2::BufferCore& buffer_;
  std::atomic<std::uint64_t> refused_{0};
  std::atomic<std::uint32_t> clock_steps_{0};
  mutable std::mutex mutex_;
  std::map<std::string, double> ahead_;  ///< s, by child frame; only frames refused last
  std::int64_t last_now_ns_ = 0;
  ros::CallbackQueue queue_;
  ros::Subscriber dynamic_, static_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
};

/// Reads the newest transform from a tf2 buffer. Any thread but the control thread.
class TfGoalSource : public GoalSource {
 public:
  /// @param listener fills the buffer; both outlive the source
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
