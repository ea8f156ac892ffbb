#include "lwr_fri_bridge/fri/session.hpp"

#include <cmath>

namespace lwr_fri_bridge::fri {
namespace {

// A counter that runs this far ahead is not a gap any more: 1 s of silence at 1 kHz is a lost
// connection.
constexpr int kLargestGap = 1000;
// Successive counters prove that the controller's counter began anew; fewer, or for a shorter time,
// may be a replay.
constexpr int kProofOfRestart = 3;
constexpr double kProofTime = 0.1;  // s
// No joint of the arm is faster (KRC limit of A4, 250 deg/s), so no set-point is either; with half
// as much again.
constexpr float kFastestSetPoint = 6.6F;                          // rad/s
constexpr float kSetPointAllowance = 0.02F;                       // rad
constexpr float kLargestAngle = 6.4F;                             // rad; the arm reaches 2.97
constexpr float kShortestCycle = 0.0005F, kLongestCycle = 0.11F;  // s; FRI offers 1..100 ms

template <std::size_t N>
bool allFinite(const float (&values)[N]) {
  bool finite = true;
  for (const float value : values) finite = finite && std::isfinite(value);
  return finite;
}

template <std::size_t N>
bool allWithin(const float (&values)[N], float bound) {
  bool within = true;
  for (const float value : values) within = within && std::fabs(value) <= bound;  // false for NaN
  return within;
}

bool validCycle(float seconds) { return seconds >= kShortestCycle && seconds <= kLongestCycle; }

}  // namespace

double cycleTimeOf(const MeasurementDatagram& m) {
  // float32 of 0.001 is off by 5e-11: rounding to microseconds gives back what the KRL program
  // asked for.
  const float seconds = validCycle(m.command_period) ? m.command_period : m.measurement_period;
  return std::round(static_cast<double>(seconds) * 1e6) * 1e-6;
}

bool plausible(const MeasurementDatagram& m) {
  if (m.state != static_cast<std::uint16_t>(FriState::Monitor) &&
      m.state != static_cast<std::uint16_t>(FriState::Command)) {
    return false;
  }
  if (m.quality > static_cast<std::uint16_t>(Quality::Perfect)) return false;
  if (m.control > static_cast<std::uint16_t>(ControlStrategy::JointImpedance)) return false;
  if (!validCycle(m.command_period) && !validCycle(m.measurement_period)) return false;
  return allWithin(m.measured_position, kLargestAngle) &&
         allWithin(m.commanded_position, kLargestAngle) &&
         allWithin(m.commanded_position_offset, 2.0F * kLargestAngle) &&
         allFinite(m.measured_torque) && allFinite(m.external_torque) &&
         allFinite(m.external_wrench) && allFinite(m.commanded_frame) &&
         allFinite(m.commanded_frame_offset);
}

void cartesianSetPointOf(const MeasurementDatagram& m, float (&frame)[kFrameValues]) {
  const float* c = m.commanded_frame;
  const float* o = m.commanded_frame_offset;
  float rotation = 0.0F;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rotation += std::fabs(o[4 * row + column]);
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      float value = c[4 * row + column];
      if (rotation > 0.0F) {
        value = column == 3 ? c[4 * row + 3] : 0.0F;
        for (int k = 0; k < 3; ++k) value += c[4 * row + k] * o[4 * k + column];
      }
      frame[4 * row + column] = value;
    }
  }
}

bool Session::setPointLeaps(const MeasurementDatagram& candidate, std::uint32_t cycles) const {
  float now[kJoints];
  setPointOf(candidate, now);
  const float allowed = kSetPointAllowance + kFastestSetPoint *
                                                 static_cast<float>(cycleTimeOf(candidate)) *
                                                 static_cast<float>(cycles);
  for (std::size_t i = 0; i < kJoints; ++i) {
    if (!(std::fabs(now[i] - set_point_[i]) <= allowed)) return true;
  }
  return false;
}

bool Session::newPeriod(const MeasurementDatagram& candidate) const {
  return std::fabs(cycleTimeOf(candidate) - period_) > 1e-9;
}

Verdict Session::checkOrder(const MeasurementDatagram& candidate, Reception& reception) {
  const std::uint16_t counter = candidate.header.counter;
  // friOpen sets the period, and command mode has to be left for it.
  reception.new_period = newPeriod(candidate);
  if (reception.new_period && candidate.state == static_cast<std::uint16_t>(FriState::Command))
    return Verdict::Implausible;
  if (lenient_ && counter == 0 && candidate.header.reflected == 0) {
    reception.cycles = 1;
    reception.answer_arrived = true;
    return setPointLeaps(candidate, 1) ? Verdict::Implausible : Verdict::Accepted;
  }
  const auto difference =
      static_cast<std::int16_t>(static_cast<std::uint16_t>(counter - received_));
  if (difference == 0) return Verdict::Duplicate;
  if (difference < 0 || difference > kLargestGap) return Verdict::OutOfOrder;
  reception.cycles = static_cast<std::uint32_t>(difference);
  reception.reflected = candidate.header.reflected;
  reception.answer_arrived = answered_ && candidate.header.reflected == sent_;
  return setPointLeaps(candidate, reception.cycles) ? Verdict::Implausible : Verdict::Accepted;
}

Reception Session::receive(const std::uint8_t* bytes, std::size_t size,
                           MeasurementDatagram& measurement) {
  Reception reception;
  MeasurementDatagram candidate;
  if (!decode(bytes, size, candidate)) {
    reception.verdict = Verdict::WrongSize;
    ++counters_.wrong_size;
    return reception;
  }
  const Header& header = candidate.header;
  const bool zeros = lenient_ && header.size == 0 && header.id == 0;
  if (!zeros && header.id != kMeasurementId) {
    reception.verdict = Verdict::WrongId;
    ++counters_.wrong_id;
    return reception;
  }
  if (!zeros && header.size != kMeasurementSize) {
    reception.verdict = Verdict::WrongSize;
    ++counters_.wrong_size;
    return reception;
  }
  if (!plausible(candidate)) {
    reception.verdict = Verdict::Implausible;
    ++counters_.implausible;
    return reception;
  }

  reception.verdict = connected_ ? checkOrder(candidate, reception) : Verdict::Accepted;
  reception.fresh_session = !connected_;
  if (reception.verdict == Verdict::Duplicate) {
    ++counters_.duplicate;
    return reception;
  }
  if (reception.verdict != Verdict::Accepted) {
    // Datagrams that do not fit to what came before, but to each other: the controller began anew.
    const bool successive = static_cast<std::uint16_t>(suspect_ + 1) == header.counter;
    suspects_in_a_row_ = successive && suspects_in_a_row_ > 0 ? suspects_in_a_row_ + 1 : 1;
    suspect_ = header.counter;
    if (suspects_in_a_row_ < kProofOfRestart ||
        suspects_in_a_row_ * cycleTimeOf(candidate) < kProofTime) {
      ++(reception.verdict == Verdict::Implausible ? counters_.implausible
                                                   : counters_.out_of_order);
      return reception;
    }
    ++counters_.restarts;
    reception = Reception{};
    reception.verdict = Verdict::Accepted;
    reception.fresh_session = true;
  }

  suspects_in_a_row_ = 0;
  if (reception.fresh_session) {
    answered_ = false;
    reception.reflected = header.reflected;
  } else {
    if (reception.new_period) ++counters_.new_periods;
    counters_.lost_measurements += reception.cycles - 1;
    if (answered_ && !reception.answer_arrived) ++counters_.lost_answers;
  }
  ++counters_.accepted;
  connected_ = true;
  received_ = header.counter;
  setPointOf(candidate, set_point_);
  period_ = cycleTimeOf(candidate);
  measurement = candidate;
  return reception;
}

Header Session::nextHeader() {
  ++sent_;
  answered_ = true;
  return commandHeader(sent_, received_);
}

void Session::forget() {
  connected_ = false;
  answered_ = false;
  suspects_in_a_row_ = 0;
}

}  // namespace lwr_fri_bridge::fri
