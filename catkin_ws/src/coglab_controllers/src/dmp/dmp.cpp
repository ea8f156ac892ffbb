#include "coglab_controllers/dmp/dmp.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace coglab_controllers {
namespace {

// Longest sub-step of the integration, as a share of the fastest time constant of the linear part
// and of the distance in time of two basis functions: the error of a whole motion is then some
// micrometres at most, whatever the cycle time.
constexpr double kPoleShare = 0.1, kBasisShare = 0.5;

// Phase of a motion that has ended: nothing is left of its shape.
constexpr double kEndPhase = 1e-6;

}  // namespace

void Dmp::start(const TransformationSystem& system, const Vector3& position,
                const Vector3& velocity, const Vector3& goal, double ratio) noexcept {
  system_ = system;
  tau_ = ratio * system_.duration();
  start_ = position;
  system_.mapShape(start_, goal);
  state_ = {position, velocity, Vector3::Zero(), 1.0};
  phi_ = system_.movingPoint(1.0);
}

void Dmp::switchTo(const TransformationSystem& system, const Vector3& goal, double ratio) noexcept {
  system_ = system;
  tau_ = ratio * system_.duration();
  system_.mapShape(start_, goal);
  phi_ = system_.movingPoint(state_.phase);
}

void Dmp::endAt(const Vector3& position) noexcept {
  state_ = {position, Vector3::Zero(), Vector3::Zero(), std::min(state_.phase, kEndPhase)};
  phi_ = system_.movingPoint(state_.phase);
}

void Dmp::setRatio(double ratio) noexcept { tau_ = ratio * system_.duration(); }

const DmpState& Dmp::step(double dt, const Vector3& goal, const Vector3& goal_velocity,
                          double rate) noexcept {
  const double total = dt * rate;
  if (!(total > 0.0)) return state_;
  // Seen from a slowed clock the goal moves faster; a clock that nearly stands does not run after
  // it.
  const Vector3 goal_rate = goal_velocity / std::max(rate, 0.1);
  const double pole = tau_ / std::max(std::sqrt(system_.stiffness()), 0.5 * system_.damping());
  const double longest = std::min(kPoleShare * pole, kBasisShare * tau_ / system_.basisCount());
  const int count = std::clamp(static_cast<int>(std::ceil(total / longest - 1e-9)), 1, 10000);
  const double h = total / count;
  Vector3 x = state_.position, v = tau_ * state_.velocity;
  const CanonicalSystem& canonical = system_.canonical();
  const double half_decay = canonical.advance(1.0, 0.5 * h, tau_);
  double s = state_.phase;
  Vector3 forcing = Vector3::Zero();
  for (int i = 0; i < count; ++i) {
    const double s_half = s * half_decay, s_end = s_half * half_decay;
    const Vector3 phi_half = system_.movingPoint(s_half), phi_end = system_.movingPoint(s_end);
    const auto force = [&](double phase, const Vector3& phi, double elapsed) {
      const Vector3 goal_now = goal + goal_velocity * (elapsed / std::max(rate, 0.1));
      return system_.forcing(system_.goalWeight(phase), phi, start_, goal_now, goal_rate, tau_);
    };
    const Vector3 f0 = force(s, phi_, i * h), f1 = force(s_half, phi_half, (i + 0.5) * h);
    forcing = force(s_end, phi_end, (i + 1) * h);
    const Vector3 kx1 = v, kv1 = system_.acceleration(f0, x, v);
    const double a = 0.5 * h / tau_, b = h / tau_;
    const Vector3 kx2 = v + a * kv1, kv2 = system_.acceleration(f1, x + a * kx1, kx2);
    const Vector3 kx3 = v + a * kv2, kv3 = system_.acceleration(f1, x + a * kx2, kx3);
    const Vector3 kx4 = v + b * kv3, kv4 = system_.acceleration(forcing, x + b * kx3, kx4);
    x += b / 6.0 * (kx1 + 2.0 * kx2 + 2.0 * kx3 + kx4);
    v += b / 6.0 * (kv1 + 2.0 * kv2 + 2.0 * kv3 + kv4);
    s = s_end;
    phi_ = phi_end;
  }
  state_.position = x;
  state_.velocity = v / tau_;
  state_.acceleration = system_.acceleration(forcing, x, v) / (tau_ * tau_);
  state_.phase = s;
  return state_;
}

double Dmp::progress() const noexcept {
  return std::min(1.0, system_.canonical().timeAt(std::max(state_.phase, 1e-300), 1.0));
}

double Dmp::remainingTime() const noexcept { return (1.0 - progress()) * tau_; }

void requireRatio(double ratio) {
  if (ratio >= 0.05 && ratio <= 100.0) return;
  throw std::invalid_argument(
      "dmp_ratio: expected a number from 0.05 to 100 (1: duration of the demonstration), got " +
      std::to_string(ratio));
}

}  // namespace coglab_controllers
