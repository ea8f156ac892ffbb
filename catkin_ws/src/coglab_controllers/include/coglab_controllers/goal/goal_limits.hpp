/// @file
/// Checks of a moving goal (limits in config/controllers.yaml): which goal frames a motion accepts,
/// and when the motion ends because the goal leaves, retreats or drops.
#pragma once

#include <cstdint>

#include "coglab_controllers/kinematics/types.hpp"
#include "coglab_controllers/names.hpp"

namespace coglab_controllers {

/// A goal frame as received: a pose from tf2, or a position from dmp_goal with the identity as
/// orientation.
struct GoalObservation {
  Vector3 position = Vector3::Zero();               ///< m, in dmp_frame_name
  Quaternion orientation = Quaternion::Identity();  ///< of the goal frame, in dmp_frame_name
  /// Time of capture, clock of the samples. It gives the age of the frame. It does not identify the
  /// frame: a stamp that is mapped twice from another clock gives two values.
  std::int64_t stamp_ns = 0;
  /// Stamp as received, ns. It identifies the frame; later frames have larger stamps. 0: no stamp;
  /// the frame is valid as long as it is received (a static transform).
  std::int64_t frame_ns = 0;
  /// Number of backward steps of the clock of frame_ns. Stamps from before and after a step are not
  /// comparable.
  std::uint32_t clock_steps = 0;
  std::uint64_t request = 0;  ///< number of the request for this frame; set by GoalInput

  /// True if this is a later frame than `other`, both with a stamp.
  bool isLaterThan(const GoalObservation& other) const noexcept {
    return clock_steps != other.clock_steps || frame_ns > other.frame_ns;
  }
};

/// Limits of the frames, the same for all motions.
struct GoalFrameLimits {
  double max_age =
      0.2;  ///< s: an older frame holds the last goal; 0: a goal stays valid until replaced
  double max_jump = 0.15;  ///< m from one frame to the next; a larger jump holds the last goal …
  int frames_to_accept = 3;  ///< … until this many frames in a row agree within `agreement`
  double agreement = 0.05;   ///< m
  double lost_time = 1.0;  ///< s without a believable frame after which the goal is lost; 0: never
};

/// Limits of a request: where the goal may go during the motion. The defaults allow everything.
struct GoalBounds {
  Vector3 region_low = Vector3::Zero();   ///< m, corners of a box in dmp_frame_name that a goal
  Vector3 region_high = Vector3::Zero();  ///< which was inside may not leave; equal: anywhere
  double retreat = 0.0;  ///< m, largest retreat from its point nearest to the hand; 0: no limit
  double drop = 0.0;     ///< m, largest sinking below its average over kDropTime; 0: no limit

  /// Describes the first invalid limit; empty if all are valid.
  const char* wrong() const noexcept;
};

/// Holds the last accepted goal and checks its motion. Before begin() there is no goal: the first
/// one is accepted once frames_to_accept frames agree, or at once if it is static. No allocation,
/// no throw.
class GoalLimits {
 public:
  static constexpr double kDropTime = 0.15;  ///< s

  enum class State : std::uint8_t {
    Unsettled,  ///< no goal is accepted yet
    Fresh,      ///< the newest frame is followed
    Old,        ///< the newest frame is too old: the last goal is held
    Jumped,     ///< the newest frames are too far away: the last goal is held
    Lost        ///< held for longer than lost_time
  };

  explicit GoalLimits(const GoalFrameLimits& frames = {}) : frames_(frames) {}

  /// Starts a motion with this goal and forgets the previous one.
  /// @param hand where the motion begins, m, in dmp_frame_name
  void begin(const GoalObservation& first, const Vector3& hand = Vector3::Zero(),
             const GoalBounds& bounds = {}) noexcept;

  /// One cycle.
  /// @param now_ns clock of the samples
  /// @param newest the newest frame received, the same one until a newer one comes; each frame is
  /// judged once
  /// @param arm_ns clock of the arm. A frame that has arrived ages by this clock: it is slower than
  /// now_ns while a busy computer slows the simulated cell down.
  State update(std::int64_t now_ns, const GoalObservation& newest, std::int64_t arm_ns) noexcept;

  /// Checks the goal against the bounds of the motion, once per cycle of `dt` s.
  /// @return reason to end the motion; empty if it may continue
  Reason checkBounds(double dt) noexcept { return checkBounds(dt, goal_.position); }
  /// The same for a goal (m) that did not pass update().
  Reason checkBounds(double dt, const Vector3& goal) noexcept;

  const GoalObservation& goal() const noexcept { return goal_; }  ///< the one to follow
  double age() const noexcept { return seconds(age_ns_); }        ///< s, of the newest frame
  double jump() const noexcept { return jump_; }  ///< m, of the newest frame against the goal held
  State state() const noexcept { return state_; }

 private:
  static double seconds(std::int64_t ns) noexcept { return 1e-9 * static_cast<double>(ns); }
  bool isNew(const GoalObservation& newest) const noexcept;
  void judge(const GoalObservation& newest) noexcept;
  void grow(std::int64_t now_ns, bool arrived, std::int64_t arm_ns) noexcept;
  void believe(const GoalObservation& newest) noexcept;
  bool outside(const Vector3& goal) const noexcept;

  GoalFrameLimits frames_;
  GoalObservation goal_;
  GoalObservation candidate_;
  GoalObservation last_;                   // the newest frame judged
  int agreeing_ = 0;                       // frames in a row that agree, but not with the goal
  bool settled_ = false;                   // a goal is accepted
  bool seen_ = false;                      // a frame was judged
  std::int64_t arm_ns_ = -1;               // of the last cycle; -1: none since begin()
  std::int64_t age_ns_ = 0, held_ns_ = 0;  // of the newest frame and of the accepted goal
  double jump_ = 0.0;
  State state_ = State::Unsettled;

  GoalBounds bounds_;
  Vector3 hand_ = Vector3::Zero();
  double nearest_ = 0.0;  // m, smallest distance from hand_ so far
  double height_ = 0.0;   // m, averaged
  bool was_inside_ = false;
};

}  // namespace coglab_controllers
