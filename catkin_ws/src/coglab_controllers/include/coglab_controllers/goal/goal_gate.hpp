/// @file
/// Which goal frames a motion believes (docs/reference.md has the limits): age, jumps, loss.
#pragma once

#include <cstdint>

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// A goal frame as received: from tf2 its pose, from dmp_goal its position with the identity as
/// orientation.
struct GoalObservation {
  Vector3 position = Vector3::Zero();               ///< m, in dmp_frame_name
  Quaternion orientation = Quaternion::Identity();  ///< of the goal frame, in dmp_frame_name
  /// Time of capture, clock of the samples. It says how old the frame is, not which one: mapped
  /// from another clock twice, one frame has two of them.
  std::int64_t stamp_ns = 0;
  /// Which frame it is: its stamp as received, ns; later ones are larger. 0: it has none and is
  /// valid as long as it is shown (a static transform).
  std::int64_t frame_ns = 0;
  /// How often the clock of frame_ns has stepped back so far: after a step stamps begin anew.
  std::uint32_t clock_steps = 0;
  std::uint64_t request = 0;  ///< which request asked for this frame; set by GoalFeed

  /// Whether this is a later frame than `other`, both with a stamp.
  bool isLaterThan(const GoalObservation& other) const noexcept {
    return clock_steps != other.clock_steps || frame_ns > other.frame_ns;
  }
};

/// Limits of GoalGate.
struct GoalGateParameters {
  double max_age =
      0.2;  ///< s: an older frame holds the last goal; 0: a goal stays valid until replaced
  double max_jump = 0.15;    ///< m from one frame to the next; a larger one holds the last goal …
  int frames_to_accept = 3;  ///< … until this many frames in a row agree within `agreement`
  double agreement = 0.05;   ///< m
  double lost_time = 1.0;  ///< s without a believable frame after which the goal is lost; 0: never
};

/// Holds the last believable goal. Until reset() there is none: it is believed once
/// frames_to_accept frames agree, or at once if it is static. No allocation, no throw.
class GoalGate {
 public:
  enum class State : std::uint8_t {
    Unsettled,  ///< no goal is believed yet
    Fresh,      ///< the newest frame is followed
    Old,        ///< no frame young enough: the last goal is held
    Jumped,     ///< the newest frames are too far away: the last goal is held
    Lost        ///< held for longer than lost_time
  };

  explicit GoalGate(const GoalGateParameters& parameters = {}) : parameters_(parameters) {}

  /// A motion begins with this goal, whatever came before.
  void reset(const GoalObservation& first) noexcept;

  /// One cycle.
  /// @param now_ns clock of the samples
  /// @param newest the newest frame received, again and again while no newer one comes; each is
  /// judged once
  State update(std::int64_t now_ns, const GoalObservation& newest) noexcept;

  const GoalObservation& goal() const noexcept { return goal_; }  ///< the one to follow
  double age() const noexcept { return age_; }                    ///< s, of the newest frame
  double jump() const noexcept { return jump_; }  ///< m, of the newest frame against the goal held
  State state() const noexcept { return state_; }
  const GoalGateParameters& parameters() const noexcept { return parameters_; }

 private:
  bool isNew(const GoalObservation& newest) const noexcept;
  void judge(const GoalObservation& newest) noexcept;
  void believe(const GoalObservation& newest) noexcept;

  GoalGateParameters parameters_;
  GoalObservation goal_;
  GoalObservation candidate_;
  GoalObservation last_;  // the newest frame judged
  int agreeing_ = 0;      // frames in a row that agree, but not with the goal
  bool settled_ = false;  // a goal is believed
  bool seen_ = false;     // a frame was judged
  std::int64_t believed_ns_ = 0;
  double age_ = 0.0;
  double jump_ = 0.0;
  State state_ = State::Unsettled;
};

}  // namespace coglab_controllers
