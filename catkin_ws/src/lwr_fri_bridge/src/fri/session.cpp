#include "lwr_fri_bridge/fri/session.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace lwr_fri_bridge::fri {
namespace {

// A larger jump of the counter is no gap: 1 s of silence at 1 kHz is a lost connection.
constexpr int kLargestGap = 1000;
// So many successive counters over kProofTime prove that the controller's counter restarted. Fewer,
// or a shorter time, may be a replay.
constexpr int kProofOfRestart = 3;
constexpr double kProofTime = 0.1;  // s
// Largest speed of set-point and arm, rad/s: 1.5 times the KRC's limits (rsidef7.dat: 120 120 160
// 160 250 220 220 deg/s).
constexpr float kFastest[kJoints] = {3.15F, 3.15F, 4.2F, 4.2F, 6.6F, 5.8F, 5.8F};
constexpr float kSetPointAllowance = 0.02F;                       // rad
constexpr float kMeasuredAllowance = 0.005F;                      // rad, noise and rounding
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
  // float32 of 0.001 is off by 5e-11. Rounding to microseconds restores the value of the KRL
  // program.
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

bool Session::leaps(const MeasurementDatagram& candidate, std::uint32_t cycles) const {
  float set_point[kJoints];
  setPointOf(candidate, set_point);
  const float time = static_cast<float>(cycleTimeOf(candidate)) * static_cast<float>(cycles);
  bool leap = false;
  for (std::size_t i = 0; i < kJoints; ++i) {
    const float reach = kFastest[i] * time;
    leap =
        leap || !(std::fabs(set_point[i] - set_point_[i]) <= kSetPointAllowance + reach) ||
        !(std::fabs(candidate.measured_position[i] - measured_[i]) <= kMeasuredAllowance + reach);
  }
  return leap;
}

bool Session::newPeriod(const MeasurementDatagram& candidate) const {
  return std::fabs(cycleTimeOf(candidate) - period_) > 1e-9;
}

Verdict Session::checkOrder(const MeasurementDatagram& candidate, Reception& reception) {
  const std::uint16_t counter = candidate.header.counter;
  // friOpen sets the period, which is not possible in command mode.
  reception.new_period = newPeriod(candidate);
  if (reception.new_period && candidate.state == static_cast<std::uint16_t>(FriState::Command))
    return Verdict::Implausible;
  if (lenient_ && counter == 0 && candidate.header.reflected == 0) {
    reception.cycles = 1;
    reception.answer_arrived = true;
    return leaps(candidate, 1) ? Verdict::Implausible : Verdict::Accepted;
  }
  const auto difference =
      static_cast<std::int16_t>(static_cast<std::uint16_t>(counter - received_));
  if (difference == 0) return Verdict::Duplicate;
  if (difference < 0 || difference > kLargestGap) return Verdict::OutOfOrder;
  reception.cycles = static_cast<std::uint32_t>(difference);
  reception.answer_arrived = answered_ && candidate.header.reflected == sent_;
  return leaps(candidate, reception.cycles) || !history_.explains(candidate) ? Verdict::Implausible
                                                                             : Verdict::Accepted;
}

Verdict Session::checkForm(const std::uint8_t* bytes, std::size_t size,
                           MeasurementDatagram& candidate) {
  Verdict verdict = Verdict::Accepted;
  if (!decode(bytes, size, candidate)) {
    ++counters_.wrong_size;
    return Verdict::WrongSize;
  }
  const Header& header = candidate.header;
  const bool zeros = lenient_ && header.size == 0 && header.id == 0;
  if (!zeros && header.id != kMeasurementId) {
    verdict = Verdict::WrongId;
    ++counters_.wrong_id;
  } else if (!zeros && header.size != kMeasurementSize) {
    verdict = Verdict::WrongSize;
    ++counters_.wrong_size;
  } else if (!plausible(candidate)) {
    verdict = Verdict::Implausible;
    ++counters_.implausible;
  }
  return verdict;
}

/// True if the controller's counter restarted: several datagrams do not continue the old counter
/// but follow each other.
bool Session::provesRestart(const MeasurementDatagram& candidate) {
  const bool successive = static_cast<std::uint16_t>(suspect_ + 1) == candidate.header.counter;
  suspects_in_a_row_ = successive && suspects_in_a_row_ > 0 ? suspects_in_a_row_ + 1 : 1;
  suspect_ = candidate.header.counter;
  return suspects_in_a_row_ >= kProofOfRestart &&
         suspects_in_a_row_ * cycleTimeOf(candidate) >= kProofTime;
}

Reception Session::receive(const std::uint8_t* bytes, std::size_t size,
                           MeasurementDatagram& measurement) {
  Reception reception;
  MeasurementDatagram candidate;
  reception.verdict = checkForm(bytes, size, candidate);
  if (reception.verdict != Verdict::Accepted) return reception;

  reception.verdict = connected_ ? checkOrder(candidate, reception) : Verdict::Accepted;
  reception.fresh_session = !connected_;
  if (reception.verdict == Verdict::Duplicate) {
    ++counters_.duplicate;
    return reception;
  }
  if (reception.verdict != Verdict::Accepted) {
    if (!provesRestart(candidate)) {
      ++(reception.verdict == Verdict::Implausible ? counters_.implausible
                                                   : counters_.out_of_order);
      return reception;
    }
    ++counters_.restarts;
    reception = Reception{};
    reception.verdict = Verdict::Accepted;
    reception.fresh_session = true;
  }
  accept(candidate, reception);
  measurement = candidate;
  return reception;
}

void Session::accept(const MeasurementDatagram& candidate, const Reception& reception) {
  suspects_in_a_row_ = 0;
  if (reception.fresh_session) {
    answered_ = false;
  } else {
    if (reception.new_period) ++counters_.new_periods;
    counters_.lost_measurements += reception.cycles - 1;
    if (answered_ && !reception.answer_arrived) ++counters_.lost_answers;
  }
  ++counters_.accepted;
  connected_ = true;
  received_ = candidate.header.counter;
  setPointOf(candidate, set_point_);
  std::copy(std::begin(candidate.measured_position), std::end(candidate.measured_position),
            measured_);
  period_ = cycleTimeOf(candidate);
}

Header Session::nextHeader() {
  ++sent_;
  answered_ = true;
  return commandHeader(sent_, received_);
}

void Session::sent(SentSetPoint set_point) {
  set_point.counter = sent_;
  set_point.measurement = received_;
  set_point.valid = true;
  history_.record(set_point);
}

void Session::forget() {
  history_.forget();
  connected_ = false;
  answered_ = false;
  suspects_in_a_row_ = 0;
}

}  // namespace lwr_fri_bridge::fri
