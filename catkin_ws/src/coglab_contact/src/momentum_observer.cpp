#include "coglab_contact/momentum_observer.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace coglab_contact {
namespace {

constexpr double kLongestGap = 0.05;  // s between two samples; after a longer one it restarts
constexpr double kSilence = 1.0;  // s; then the robot may have begun a session with another time
// Periods, largest distance of a stamp from the grid of the measurements. Beyond that, the number
// of passed periods is unclear, and a wrong number would look like a push.
constexpr double kBeside = 0.4;
// Nm, difference of one sample from the estimate; a larger one may come from a wrong stamp.
constexpr double kJump = 12.0;
constexpr int kDoubts = 2;  // samples in a row that are left out; a lasting difference is a hit

}  // namespace

MomentumObserver::MomentumObserver(std::shared_ptr<ArmModel> model, double k,
                                   double measured_period)
    : gain(k), period(measured_period), model_(std::move(model)) {
  if (!(gain > 0.0) || !std::isfinite(gain))
    throw std::invalid_argument("gain must be a positive number of 1/s, got " +
                                std::to_string(gain));
}

void MomentumObserver::setPayload(double mass, const Vector3& centre) {
  model_->setPayload(mass, centre);
  reset();
}

std::optional<Residual> MomentumObserver::feed(double stamp, const Joints& position,
                                               const Joints& torque, std::optional<double> made) {
  if (!std::isfinite(stamp) || !position.allFinite() || !torque.allFinite()) return std::nullopt;
  const std::optional<double> step = sinceLast(stamp, made);
  if (!step) {
    reset();
    past_.grid = stamp;
  }
  past_.made = made;
  if (step == 0.0) return std::nullopt;
  const Joints before = past_.position, torque_before = past_.torque;
  past_.stamp = stamp;
  past_.position = position;
  past_.torque = torque;
  if (step && *step < 0.0) {  // the estimate stays, the velocities restart
    past_.grid = stamp;
    past_.has_velocity = false;
    return std::nullopt;
  }
  if (!step) return std::nullopt;
  return advance(stamp, *step, before, torque_before);
}

/// Time (s) since the last sample. None: it does not follow the last one. 0: it is a repetition.
/// Negative: the time is unclear.
std::optional<double> MomentumObserver::sinceLast(double stamp, std::optional<double> made) {
  if (!past_.stamp || made.has_value() != past_.made.has_value()) return std::nullopt;
  double step = stamp - *past_.stamp;
  if (made) {
    const bool silent = !(std::abs(step) <= kSilence);
    step = *made - *past_.made;
    if (!(step >= 0.0 && step <= kLongestGap) || silent) return std::nullopt;
    return step;
  }
  if (step == 0.0) return 0.0;
  if (!(std::abs(step) <= kLongestGap)) return std::nullopt;
  if (period > 0.0) {
    // The measurements lie on a regular grid. The stamps show it with jitter, so the grid follows
    // them slowly.
    const double since = (stamp - past_.grid) / period;
    const double periods = std::max(1.0, std::nearbyint(since));
    if (std::abs(since - periods) > kBeside) return -1.0;
    past_.grid += periods * period;
    past_.grid += 0.05 * (stamp - past_.grid);
    return periods * period;
  }
  if (step > 0.0) return step;
  return std::nullopt;
}

std::optional<Residual> MomentumObserver::advance(double stamp, double step, const Joints& before,
                                                  const Joints& torque_before) {
  Past& p = past_;
  const Joints velocity = (p.position - before) / step;
  const ArmTerms terms = model_->at(0.5 * (p.position + before), velocity);
  const Joints forces = terms.gravity - terms.transposed;
  const Joints last_velocity = p.velocity, last_momentum = p.momentum, last_forces = p.forces;
  const double last_step = p.step;
  const bool first = !p.has_velocity;
  p.velocity = velocity;
  p.momentum = terms.momentum;
  p.forces = forces;
  p.step = step;
  p.has_velocity = true;
  if (first) return std::nullopt;
  // From the middle of the last interval to the middle of this one: each torque is a mean over its
  // interval.
  const double span = 0.5 * (step + last_step);
  const Joints torque = (last_step * torque_before + step * p.torque) / (step + last_step);
  const Joints rate = (p.torque - torque_before) / span;
  const Joints outside =
      (terms.momentum - last_momentum) / span + 0.5 * (forces + last_forces) - torque - lag * rate;
  const bool jumps = p.has_residual && (outside - p.residual).cwiseAbs().maxCoeff() > kJump;
  if (jumps && p.doubts < kDoubts) {
    ++p.doubts;
    p.has_velocity = false;
    return std::nullopt;
  }
  p.doubts = 0;
  const bool fresh = !p.has_residual;
  const double keep = fresh ? 0.0 : std::exp(-gain * span);
  p.residual = keep * p.residual + (1.0 - keep) * outside;
  p.acceleration = keep * p.acceleration + (1.0 - keep) * (velocity - last_velocity) / span;
  p.rate = keep * p.rate + (1.0 - keep) * rate;
  p.has_residual = true;
  return Residual{stamp, p.residual, p.position, velocity, p.acceleration, p.rate, fresh};
}

}  // namespace coglab_contact
