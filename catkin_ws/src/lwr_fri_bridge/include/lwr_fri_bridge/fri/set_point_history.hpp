/// @file
/// The set-points that we sent, and so what the controller can have made of them.
///
/// In a cycle without our answer a robot controller goes on with its last step (KUKA: it
/// extrapolates the previous commands) or it stands. Each measurement names the answer that the
/// controller saw last and the set-point that it has now. So both are known after a gap: which of
/// the two it did, and that a set-point which follows from neither is no true one.
#pragma once

#include <array>
#include <cstdint>

#include "lwr_fri_bridge/fri/datagram.hpp"

namespace lwr_fri_bridge::fri {

/// What one answer told the controller.
struct SentSetPoint {
  std::uint16_t counter = 0;      ///< of the answer
  std::uint16_t measurement = 0;  ///< counter of the measurement that it answers
  bool valid = false;
  bool followed = false;                   ///< came from the interpolator; otherwise it mirrored
  Vector7 from = Vector7::Zero();          ///< set-point before this answer, rad
  Vector7 position = Vector7::Zero();      ///< rad
  Vector7 velocity = Vector7::Zero();      ///< at its end, rad/s
  Vector7 acceleration = Vector7::Zero();  ///< at its end, rad/s^2
  float frame[kFrameValues] = {};          ///< Cartesian impedance mode, m
};

/// Where a set-point is and how it moves.
struct SetPointState {
  Vector7 position = Vector7::Zero();      ///< rad
  Vector7 velocity = Vector7::Zero();      ///< rad/s
  Vector7 acceleration = Vector7::Zero();  ///< rad/s^2
  Vector7 step = Vector7::Zero();          ///< of the last cycle, rad
};

/// Real-time safe, one thread.
class SetPointHistory {
 public:
  void record(const SentSetPoint& sent);
  void forget();
  /// Forgets what was sent: the measurement reports a set-point that moves as `state` says,
  /// whatever answer it reflects.
  void beginWith(const MeasurementDatagram& measurement, const SetPointState& state);

  /// Whether the reported set-point follows from what was sent: it lies, per joint, between the
  /// set-point before the answer that the controller saw last and where its last step has taken it
  /// since. True where we did not command, and in Cartesian impedance mode, where the joint
  /// set-point is the arm's.
  bool explains(const MeasurementDatagram& measurement) const;

  /// How the controller's set-point moves after a gap: with velocity and acceleration of the answer
  /// that it saw last if it went on, at rest if it stood. In Cartesian impedance mode the frame
  /// tells which, and the position is the one that belongs to it. `fresh`: the controller's
  /// counters began anew and tell nothing; a set-point off the way of the newest answer is at rest.
  SetPointState afterGap(const MeasurementDatagram& measurement, bool fresh) const;

 private:
  const SentSetPoint* find(std::uint16_t counter) const;

  std::array<SentSetPoint, 64> sent_{};
  std::uint16_t newest_ = 0;
};

}  // namespace lwr_fri_bridge::fri
