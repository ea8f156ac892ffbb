/// @file
/// A minimal robot controller for the tests of this package. It keeps the set-point, continues with
/// the last step or stands if an answer is lost, and runs our own KRL convention. It is independent
/// of coglab_sim, which tests the bridge as a whole.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <string>

#include "coglab_rt/joint_limits_table.hpp"
#include "lwr_fri_bridge/bridge/bridge.hpp"

namespace lwr_fri_bridge::test {

inline BridgeConfig defaultConfig(const std::string& profile = "default") {
  BridgeConfig config;
  config.limits = coglab_rt::loadJointLimits(LIMITS_FILE, profile);
  return config;
}

class SmallController {
 public:
  explicit SmallController(double period) : period_(period) {
    own_ << 0.1, 0.5, -0.2, 1.0, 0.3, -0.4, 0.6;
    measured_ = own_;
  }

  /// The datagram of this cycle. `time()` is its time stamp.
  fri::MeasurementDatagram measure() {
    fri::MeasurementDatagram m{};
    m.header = fri::measurementHeader(++counter_, last_answer_);
    m.timestamp = static_cast<float>(clock_offset + 1e-9 * static_cast<double>(now_ns_));
    m.state = static_cast<std::uint16_t>(state);
    m.quality = static_cast<std::uint16_t>(quality);
    m.control = static_cast<std::uint16_t>(control);
    m.power = power;
    m.measurement_period = m.command_period = static_cast<float>(period_);
    fri::jointsToWire(measured_, m.measured_position);
    fri::jointsToWire(own_, m.commanded_position);
    fri::jointsToWire(offset_, m.commanded_position_offset);
    std::copy(std::begin(frame_), std::end(frame_), m.commanded_frame);
    for (int i = 0; i < 3; ++i) m.commanded_frame_offset[5 * i] = 1.0F;
    m.krl.ints[15] = fri::kCoglabProgramMark;
    m.krl.ints[0] = finished_;
    m.krl.ints[1] = finished_ != 0 ? 1 : 0;
    now_ns_ += static_cast<std::int64_t>(std::llround(period_ * 1e9));
    return m;
  }

  /// Takes the answer; if there is none, goes on with the last step or stands.
  void take(const fri::CommandDatagram* answer) {
    Vector7 next = setPoint();
    if (answer != nullptr) {
      last_answer_ = answer->header.counter;
      next = fri::jointsFromWire(answer->joint_position);
      runProgram(answer->krl);
    } else if (extrapolates) {
      next += last_step_;
    }
    if (state == fri::FriState::Command && fri::allDrivesOn(power)) {
      last_step_ = next - setPoint();
      offset_ = next - own_;
      if (answer != nullptr && control == fri::ControlStrategy::CartesianImpedance)
        std::copy(std::begin(answer->cartesian_frame), std::end(answer->cartesian_frame), frame_);
      if (!blocked) measured_ = setPoint();
    } else {
      last_step_.setZero();
    }
  }

  /// One whole cycle in lockstep; `lose_measurement` / `lose_answer` drop one of the datagrams.
  bool cycle(Bridge& bridge, bool lose_measurement = false, bool lose_answer = false) {
    const fri::MeasurementDatagram m = measure();
    fri::CommandDatagram answer{};
    std::uint8_t bytes[fri::kMeasurementSize];
    fri::encode(m, bytes);
    bool answered = false;
    if (!lose_measurement) {
      answered = bridge.answer(bytes, sizeof bytes, now_ns_, answer);
      if (answered) this->answer = answer;
    }
    take(answered && !lose_answer ? &answer : nullptr);
    return answered;
  }

  Vector7 setPoint() const { return own_ + offset_; }
  std::int64_t now() const { return now_ns_; }
  double period() const { return period_; }
  /// Does not run for this time, s.
  void wait(double seconds) { now_ns_ += static_cast<std::int64_t>(std::llround(seconds * 1e9)); }
  void moveOwn(const Vector7& own) { own_ = own; }
  void setMeasured(const Vector7& measured) { measured_ = measured; }
  const Vector7& measured() const { return measured_; }
  const Vector7& own() const { return own_; }
  /// friOpen with another period, s.
  void setPeriod(double period) { period_ = period; }
  /// Its Cartesian set-point leaps along x by so many m, as where it goes on by itself in a gap.
  void moveFrame(double x) { frame_[3] += static_cast<float>(x); }
  void setCounter(std::uint16_t counter) { counter_ = counter; }

  fri::FriState state = fri::FriState::Monitor;
  fri::Quality quality = fri::Quality::Perfect;
  fri::ControlStrategy control = fri::ControlStrategy::Position;
  std::uint16_t power = fri::kAllDrivesOn;
  double clock_offset = 0.0;  ///< s, of its time stamps
  bool obeys = true;          ///< whether the KRL program runs
  bool blocked = false;       ///< something holds the arm
  bool extrapolates = true;   ///< continues with the last step if an answer is lost; else it stands
  fri::CommandDatagram answer{};

 private:
  void runProgram(const fri::UserData& krl) {
    if (!obeys || krl.ints[2] == finished_ || krl.ints[2] == 0) return;
    finished_ = krl.ints[2];
    if (krl.ints[0] == 1) {
      control = static_cast<fri::ControlStrategy>(krl.ints[1] / 10);
      state = fri::FriState::Command;
    } else if (krl.ints[0] == 2) {
      state = fri::FriState::Monitor;
    }
  }

  double period_;
  Vector7 own_, offset_ = Vector7::Zero(), measured_, last_step_ = Vector7::Zero();
  float frame_[fri::kFrameValues] = {1, 0, 0, 0.6F, 0, 1, 0, 0, 0, 0, 1, 0};
  std::uint16_t counter_ = 100, last_answer_ = 0;
  std::int32_t finished_ = 0;
  std::int64_t now_ns_ = 1'000'000'000;
};

/// Submits `event` and runs cycles until it ends (at most `limit` s of simulated time).
inline Outcome runEvent(Bridge& bridge, SmallController& robot, const std::string& event,
                        double limit = 20.0) {
  const std::uint32_t ticket = bridge.submit(event);
  for (int i = 0; i < static_cast<int>(limit / robot.period()); ++i) {
    robot.cycle(bridge);
    const Outcome outcome = bridge.outcome(ticket);
    if (outcome.code != OutcomeCode::Pending) return outcome;
  }
  return Outcome{};
}

/// Sends a target velocity as the control thread does.
inline void drive(Bridge& bridge, const SmallController& robot, const Vector7& velocity) {
  RobotSample sample;
  bridge.mailboxes().newestSample(sample);
  bridge.mailboxes().sendVelocity({velocity, robot.now(), sample.motion_epoch});
}

}  // namespace lwr_fri_bridge::test
