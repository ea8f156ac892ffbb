/// Set-points that a controller can have after a gap: check and take-over.
#include <gtest/gtest.h>

#include <cmath>

#include "lwr_fri_bridge/fri/set_point_history.hpp"

namespace lwr_fri_bridge::fri {
namespace {

constexpr std::uint16_t kAnswer = 40, kMeasured = 200;

/// A measurement of command mode `missed` cycles after the one that took the answer kAnswer, with
/// the set-point `position`.
MeasurementDatagram reported(const Vector7& position, int missed = 0) {
  MeasurementDatagram m{};
  m.header.counter = static_cast<std::uint16_t>(kMeasured + 1 + missed);
  m.header.reflected = kAnswer;
  m.state = static_cast<std::uint16_t>(FriState::Command);
  m.control = static_cast<std::uint16_t>(ControlStrategy::Position);
  m.power = 0x7F;
  jointsToWire(position, m.commanded_position);
  for (int i = 0; i < 3; ++i) m.commanded_frame[5 * i] = 1.0F;
  return m;
}

Vector7 unit(int joint, double value) {
  Vector7 v = Vector7::Zero();
  v[joint] = value;
  return v;
}

SentSetPoint answer(const Vector7& from, const Vector7& position) {
  SentSetPoint sent;
  sent.counter = kAnswer;
  sent.measurement = kMeasured;
  sent.valid = sent.followed = true;
  sent.from = from;
  sent.position = position;
  sent.velocity = Vector7::Constant(0.5);
  sent.acceleration = Vector7::Constant(-2.0);
  for (int i = 0; i < 3; ++i) sent.frame[5 * i] = 1.0F;
  return sent;
}

/// A history whose newest answer moved one joint by `step` to 0.1 rad.
SetPointHistory moved(int joint, double step) {
  SetPointHistory history;
  history.record(answer(unit(joint, 0.1 - step), unit(joint, 0.1)));
  return history;
}

TEST(SetPointHistory, UncommandedSetPointsAreNotChecked) {
  const SetPointHistory history = moved(0, 0.01);
  const MeasurementDatagram off = reported(unit(0, 1.0));
  ASSERT_FALSE(history.explains(off));
  MeasurementDatagram m = off;
  m.state = static_cast<std::uint16_t>(FriState::Monitor);
  EXPECT_TRUE(history.explains(m));
  m = off;
  m.power = 0x3F;
  EXPECT_TRUE(history.explains(m));
  m = off;
  m.control = static_cast<std::uint16_t>(ControlStrategy::CartesianImpedance);
  EXPECT_TRUE(history.explains(m));  // there the joint set-point is the arm's
  m = off;
  m.control = static_cast<std::uint16_t>(ControlStrategy::JointImpedance);
  EXPECT_FALSE(history.explains(m));
}

TEST(SetPointHistory, AnAnswerThatWasNeverSentExplainsNothing) {
  SetPointHistory history = moved(0, 0.01);
  for (const int reflected : {0, 39, 41, 40 + 64, 40 - 64}) {
    MeasurementDatagram m = reported(unit(0, 0.1));
    ASSERT_TRUE(history.explains(m));
    m.header.reflected = static_cast<std::uint16_t>(reflected);
    EXPECT_FALSE(history.explains(m)) << reflected;
  }
  history.forget();
  EXPECT_TRUE(history.explains(reported(unit(0, 1.0))));  // nothing is known
}

}  // namespace
}  // namespace lwr_fri_bridge::fri
