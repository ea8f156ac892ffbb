#include "lwr_fri_bridge/fri/set_point_history.hpp"

#include <algorithm>
#include <cmath>

namespace lwr_fri_bridge::fri {
namespace {

constexpr double kTolerance = 1e-4;       // rad; same tolerance as controllers have on entry
constexpr float kFrameTolerance = 1e-5F;  // of an unmoved frame, m and parts of a unit vector
constexpr double kSmallestStep = 1e-6;    // rad; float32 hides whether a joint moved less
constexpr double kOffTheWay = 1e-3;       // rad, largest distance from the path of the last answer

Vector7 reportedBy(const MeasurementDatagram& m) {
  float set_point[kJoints];
  setPointOf(m, set_point);
  return jointsFromWire(set_point);
}

/// Number of cycles in which the controller had no new answer.
double missedCycles(const MeasurementDatagram& m, const SentSetPoint& seen) {
  return static_cast<std::uint16_t>(m.header.counter - seen.measurement - 1);
}

bool sameFrame(const float (&a)[kFrameValues], const float (&b)[kFrameValues]) {
  bool same = true;
  for (std::size_t i = 0; i < kFrameValues; ++i)
    same = same && std::fabs(a[i] - b[i]) <= kFrameTolerance;
  return same;
}

}  // namespace

void SetPointHistory::record(const SentSetPoint& sent) {
  sent_[sent.counter % sent_.size()] = sent;
  newest_ = sent.counter;
}

void SetPointHistory::forget() {
  for (SentSetPoint& sent : sent_) sent.valid = false;
}

void SetPointHistory::beginWith(const MeasurementDatagram& m, const SetPointState& state) {
  forget();
  SentSetPoint sent;
  sent.counter = m.header.reflected;
  sent.measurement = static_cast<std::uint16_t>(m.header.counter - 1);
  sent.valid = sent.followed = true;
  sent.from = state.position - state.step;
  sent.position = state.position;
  sent.velocity = state.velocity;
  sent.acceleration = state.acceleration;
  cartesianSetPointOf(m, sent.frame);
  record(sent);
}

const SentSetPoint* SetPointHistory::find(std::uint16_t counter) const {
  const SentSetPoint& sent = sent_[counter % sent_.size()];
  return sent.valid && sent.counter == counter ? &sent : nullptr;
}

bool SetPointHistory::explains(const MeasurementDatagram& m) const {
  if (m.state != static_cast<std::uint16_t>(FriState::Command) || !allDrivesOn(m.power) ||
      m.control == static_cast<std::uint16_t>(ControlStrategy::CartesianImpedance)) {
    return true;
  }
  const SentSetPoint* const newest = find(newest_);
  if (newest == nullptr || !newest->followed) return true;
  const SentSetPoint* const seen = find(m.header.reflected);
  if (seen == nullptr) return false;
  if (!seen->followed) return true;
  const Vector7 reported = reportedBy(m), step = seen->position - seen->from;
  const Vector7 gone_on = seen->position + missedCycles(m, *seen) * step;
  const auto low = seen->from.array().min(seen->position.array()).min(gone_on.array());
  const auto high = seen->from.array().max(seen->position.array()).max(gone_on.array());
  return (reported.array() >= low - kTolerance).all() &&
         (reported.array() <= high + kTolerance).all();
}

SetPointState SetPointHistory::afterGap(const MeasurementDatagram& m, bool fresh) const {
  SetPointState state;
  state.position = reportedBy(m);
  const SentSetPoint* const seen = find(fresh ? newest_ : m.header.reflected);
  if (seen == nullptr || !seen->followed) return state;
  const double missed = fresh ? 1.0 : missedCycles(m, *seen);
  const Vector7 step = seen->position - seen->from;
  bool went_on = true;
  if (m.control == static_cast<std::uint16_t>(ControlStrategy::CartesianImpedance)) {
    float frame[kFrameValues];
    cartesianSetPointOf(m, frame);
    went_on = !sameFrame(frame, seen->frame);
    state.position = seen->position;
    if (went_on) state.position += missed * step;
  } else if (step.cwiseAbs().maxCoeff() > kSmallestStep) {
    // Number of steps from the answer to the reported set-point.
    const Vector7 way = state.position - seen->position;
    const double steps = way.dot(step) / step.squaredNorm();
    went_on = steps > 0.5 * missed;
    if (fresh && (way - steps * step).cwiseAbs().maxCoeff() > kOffTheWay) went_on = false;
  }
  if (went_on) {
    state.velocity = seen->velocity;
    state.acceleration = seen->acceleration;
    state.step = step;
  }
  return state;
}

}  // namespace lwr_fri_bridge::fri
