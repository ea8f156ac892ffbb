/// @file
/// Transforms from /tf and /tf_static into a tf2 buffer, less those that would spoil it, and goals
/// from that buffer.
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

/// Listens in a thread of its own, in place of tf2_ros::TransformListener.
///
/// A buffer keeps a transform from the future as its newest for as long as it is ahead, mixes it
/// into those before it, and one that is further ahead than the buffer is long locks out all that
/// come after. So a stamp more than kClockTolerance_ns ahead of this computer's clock, and numbers
/// that are not finite, are refused, counted and logged with the frame and its publisher.
class TfListener {
 public:
  /// @param buffer outlives the listener
  explicit TfListener(tf2::BufferCore& buffer) : buffer_(buffer) {}
  ~TfListener() { stop(); }

  void start();
  void stop();  ///< calls the ROS master once per topic
  /// One message, as from a topic. Any thread; throws nothing.
  /// @param publisher name of the node it comes from
  void receive(const tf2_msgs::TFMessage& message, const std::string& publisher, bool is_static);

  /// Transforms refused so far.
  std::uint64_t refused() const { return refused_.load(std::memory_order_relaxed); }
  /// How often this computer's clock has stepped back, as far as messages have shown.
  std::uint32_t clockSteps() const { return clock_steps_.load(std::memory_order_relaxed); }
  /// How far the newest transform of this child frame was ahead of the clock, s, if it was refused
  /// for that; else 0.
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
  std::map<std::string, double> ahead_;  ///< s, by child frame; frames that were refused last
  std::int64_t last_now_ns_ = 0;
  ros::CallbackQueue queue_;
  ros::Subscriber dynamic_, static_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
};

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
