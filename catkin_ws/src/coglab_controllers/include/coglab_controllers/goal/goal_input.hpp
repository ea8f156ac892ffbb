/// @file
/// Source of a motion's goals: either a tf2 frame or the topic dmp_goal. Requests, topics and polls
/// write the goals; the control cycle reads them.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>

#include "coglab_controllers/goal/goal_limits.hpp"
#include "coglab_controllers/manager/motion_controller.hpp"

namespace coglab_controllers {

/// Limits of a goal from the parameters `goal_max_age` (s), `goal_max_jump` (m), `goal_lost_time`
/// (s). @throws std::runtime_error naming the parameter
GoalFrameLimits readGoalLimits(const Parameters& parameters);

/// Largest time (ns) by which a stamp may be ahead of this computer's clock. Synchronised clocks
/// differ by less. A frame further ahead is refused, because it would count as fresh for too long.
constexpr std::int64_t kClockTolerance_ns = 50'000'000;

/// Looks up poses of frames outside the control cycle: tf2, or a replacement for it.
class GoalSource {
 public:
  virtual ~GoalSource() = default;

  /// Newest pose of `frame` in `reference`, with its own stamp and its time of capture on the clock
  /// of the samples. A transform without a stamp counts as captured now.
  /// @param why set on failure: which frame is missing, or what is wrong with the transform
  virtual bool lookup(const std::string& reference, const std::string& frame,
                      GoalObservation& observation, std::string& why) = 0;

  /// Time (s) by which the newest transform of `frame` was ahead of the clock, if it was refused
  /// for that; else 0.
  virtual double ahead(const std::string& /*frame*/) { return 0.0; }
};

/// The goals of one controller. The control thread calls read() and ahead(), which never wait; all
/// others may be called from any other thread.
class GoalInput {
 public:
  /// @param frame reference frame of the goals (dmp_frame_name)  @param host outlives this object
  void configure(const std::string& frame, const GoalFrameLimits& limits, const MotionHost& host);

  /// Sets the source of frame poses. It outlives this object, or is removed with null.
  void setSource(GoalSource* source);

  /// Pose of `frame` in `reference`. @param what parameter that holds the frame's name, for errors
  Answer transform(const std::string& reference, const std::string& frame, const char* what,
                   Pose& pose);

  /// Current goal for a requested motion. Refused if there is no goal or it is too old.
  /// @param frame tf2 frame of the goal; empty: dmp_goal
  Answer first(const std::string& frame, GoalObservation& goal);
  /// From now on, goals of `frame` belong to the requested motion. @param first from first()
  void follow(const std::string& frame, const GoalObservation& first);

  /// Receives a goal from the topic dmp_goal. A goal that is not newer than the last one is
  /// refused, unless the clock of its stamps has stepped back.
  /// @param stamp_ns time on the clock of the samples; 0: now
  /// @param frame_ns stamp as received; 0: the same as stamp_ns
  Answer offer(const std::string& frame, const Vector3& position, std::int64_t stamp_ns,
               std::int64_t frame_ns);

  /// Looks up the goal frame of the current motion in the source.
  void poll();

  /// @name Control thread
  /// @{

  /// Reads the newest goal. Its field `request` is the number of the motion that it belongs to.
  void read(GoalObservation& newest) { newest_.read(newest); }
  /// Time (s) by which the newest goal is ahead of the clock, if it was refused for that; else 0.
  double ahead() const { return ahead_.load(std::memory_order_relaxed); }
  /// @}

 private:
  Answer firstOfTopic(GoalObservation& goal) const;
  bool clockSteppedBack(const GoalObservation& newest, std::int64_t now) const;

  std::string frame_;
  double max_age_ = 0.2;  // s
  const MotionHost* host_ = nullptr;

  std::mutex mutex_;
  GoalSource* source_ = nullptr;
  std::string owner_;                 // goal frame of the motion; empty: dmp_goal
  std::uint64_t request_number_ = 0;  // of the motion whose goals are written
  GoalObservation polled_;            // newest pose of that frame
  GoalObservation topic_goal_;        // newest dmp_goal
  bool topic_goal_known_ = false;
  std::atomic<double> ahead_{0.0};
  TripleBuffer<GoalObservation> newest_;
};

}  // namespace coglab_controllers
