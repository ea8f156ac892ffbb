/// @file
/// History of the sent set-points. It predicts the set-points that the controller can have.
///
/// In a cycle without our answer, a robot controller continues with its last step (KUKA: it
/// extrapolates the previous commands) or stands still. Each measurement contains the counter of
/// the last answer that the controller received, and its current set-point. After a gap this shows
/// which of the two the controller did. A set-point that fits neither is false.
#pragma once

#include <array>
#include <cstdint>

#include "lwr_fri_bridge/fri/datagram.hpp"

namespace lwr_fri_bridge::fri {

/// Set-point of one answer to the controller.
struct SentSetPoint {
  std::uint16_t counter = 0;      ///< counter of the answer
  std::uint16_t measurement = 0;  ///< counter of the answered measurement
  bool valid = false;
  bool followed = false;                   ///< true: from the interpolator; false: mirrored
  Vector7 from = Vector7::Zero();          ///< set-point before this answer, rad
  Vector7 position = Vector7::Zero();      ///< rad
  Vector7 velocity = Vector7::Zero();      ///< at the end of the step, rad/s
  Vector7 acceleration = Vector7::Zero();  ///< at the end of the step, rad/s^2
  float frame[kFrameValues] = {};          ///< Cartesian impedance mode, m
};

/// Position and motion of a set-point.
struct SetPointState {
  Vector7 position = Vector7::Zero();      ///< rad
  Vector7 velocity = Vector7::Zero();      ///< rad/s
  Vector7 acceleration = Vector7::Zero();  ///< rad/s^2
  Vector7 step = Vector7::Zero();          ///< step of the last cycle, rad
};

/// Real-time safe, one thread.
class SetPointHistory {
 public:
  void record(const SentSetPoint& sent);
  void forget();
  /// Clears the history and begins with the set-point of this measurement, which moves as given by
  /// `state`. The measurement may reflect any answer.
  void beginWith(const MeasurementDatagram& measurement, const SetPointState& state);

  /// True if the reported set-point follows from the sent answers. For each joint it must lie
  /// between the set-point before the last received answer and the one that repeating the last step
  /// gives. Also true if we did not command, and in Cartesian impedance mode, where the joint
  /// set-point is the arm's.
  bool explains(const MeasurementDatagram& measurement) const;

  /// State of the controller's set-point after a gap. If the controller continued, the set-point
  /// has velocity and acceleration of the last received answer. If it stood still, it is at rest.
  /// In Cartesian impedance mode the frame shows which, and the position is the one for this frame.
  /// `fresh`: the controller's counters restarted and are not used. A set-point off the path of the
  /// newest answer is then at rest.
  SetPointState afterGap(const MeasurementDatagram& measurement, bool fresh) const;

 private:
  const SentSetPoint* find(std::uint16_t counter) const;

  std::array<SentSetPoint, 64> sent_{};
  std::uint16_t newest_ = 0;
};

}  // namespace lwr_fri_bridge::fri
