/// @file
/// Where the goals of a motion come from: a tf2 frame, or the topic dmp_goal; one of them at a
/// time. Requests, topics and polls write; the control cycle reads.
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

/// ns by which a stamp may be ahead of this computer's clock: what clocks that are synchronised
/// differ by. A frame that is further ahead is refused, because it would count as fresh for longer
/// than it is.
constexpr std::int64_t kClockTolerance_ns = 50'000'000;

/// Poses of frames, looked up outside the control cycle: tf2, or a stand-in for it.
class GoalSource {
 public:
  virtual ~GoalSource() = default;

  /// Newest pose of `frame` in `reference`, with its own stamp and with its time of capture in the
  /// clock of the samples; a transform without a stamp counts as captured now.
  /// @param why set on failure: which frame is missing, or what is wrong with the transform
  virtual bool lookup(const std::string& reference, const std::string& frame,
                      GoalObservation& observation, std::string& why) = 0;

  /// How far the newest transform of `frame` was ahead of the clock, s, if it was refused for that;
  /// else 0.
  virtual double ahead(const std::string& /*frame*/) { return 0.0; }
};

/// The goals of one controller. The control thread calls read() and ahead(), which never wait; all
/// others may be called from any other thread.
class GoalInput {
 public:
  /// @param frame in which goals are (dmp_frame_name)  @param host outlives this object
  void configure(const std::string& frame, const GoalFrameLimits& limits, const MotionHost& host);

  /// Where poses of frames come from. Must outlive this object, or be taken away with null.
  void setSource(GoalSource* source);

  /// Pose of `frame` in `reference`. @param what name of the parameter that names it
  Answer transform(const std::string& reference, const std::string& frame, const char* what,
                   Pose& pose);

  /// The goal as it is now, for a motion that is asked for; refused if there is none, or it is old.
  /// @param frame that owns the goal; empty: dmp_goal
  Answer first(const std::string& frame, GoalObservation& goal);
  /// The motion that was asked for is on its way: from now on goals of this owner are for it.
  void follow(const std::string& frame, const GoalObservation& first);

  /// A goal from the topic dmp_goal. One that is not newer than the last one is refused, unless
  /// the clock of its stamps has stepped back.
  /// @param stamp_ns on the clock of the samples, 0: now
  /// @param frame_ns the stamp as received, 0: as stamp_ns
  Answer offer(const std::string& frame, const Vector3& position, std::int64_t stamp_ns,
               std::int64_t frame_ns);

  /// Asks the source for the frame that owns the goal.
  void poll();

  /// @name Control thread
  /// @{

  /// The newest goal of the motion whose number is in it.
  void read(GoalObservation& newest) { newest_.read(newest); }
  /// How far the newest goal is ahead of the clock if it was refused for that, s; else 0.
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
  std::string owner_;                 // frame of the motion; empty: dmp_goal
  std::uint64_t request_number_ = 0;  // of the motion whose goals are written
  GoalObservation polled_;            // newest sight of that frame
  GoalObservation topic_goal_;        // newest dmp_goal
  bool topic_goal_known_ = false;
  std::atomic<double> ahead_{0.0};
  TripleBuffer<GoalObservation> newest_;
};

}  // namespace coglab_controllers
