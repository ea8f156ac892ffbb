#include "coglab_controllers/dmp/dmp.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace coglab_controllers {
namespace {

// Longest sub-step of the integration, as a share of the fastest time constant of the linear part
// and of the time between two basis functions. The error of a whole motion is then at most a few
// micrometres for any cycle time.
constexpr double kPoleShare = 0.1, kBasisShare = 0.5;

// Basis functions are summed up in packets of this size.
constexpr int kPacket = 4;
// Exponent below which a basis function is smaller than the rounding of the sum.
constexpr double kNegligible = -40.0;

// Phase of an ended motion: its shape has no effect any more.
constexpr double kEndPhase = 1e-6;

}  // namespace

Dmp::Dmp() noexcept {
  shape_.centres.setConstant(0.5);
  shape_.widths.setConstant(1.0);
  shape_.weights.setZero();
}

Dmp::Dmp(const Primitive& primitive) : Dmp() {
  validate(primitive);
  shape_.canonical = CanonicalSystem(primitive.alpha);
  shape_.duration = primitive.duration;
  shape_.stiffness = primitive.stiffness;
  shape_.damping = primitive.damping;
  shape_.goal_weight = primitive.goal_weight;
  shape_.mapping = primitive.mapping;
  shape_.demonstrated_line = primitive.goal - primitive.start;
  const int count = primitive.basisCount();
  shape_.centres.head(count) = primitive.centres;
  shape_.widths.head(count) = primitive.widths;
  shape_.weights.topRows(count) = primitive.weights.transpose();
  // Whole packets: the spare basis functions are so far away that their share is zero.
  shape_.count = (count + kPacket - 1) / kPacket * kPacket;
  for (int i = count; i < shape_.count; ++i) {
    shape_.centres[i] = 100.0;
    shape_.widths[i] = 1e15;
  }
}

/// Rotates and scales the learnt shape from the demonstrated start-goal line to the present one.
void Dmp::mapShape(const Vector3& goal) noexcept {
  shape_map_ = shapeMap(shape_.mapping, shape_.demonstrated_line, goal - start_);
}

void Dmp::start(const Vector3& position, const Vector3& velocity, const Vector3& goal,
                double ratio) noexcept {
  tau_ = ratio * duration();
  start_ = position;
  mapShape(goal);
  state_ = {position, velocity, Vector3::Zero(), 1.0};
  phi_ = movingPoint(1.0);
}

void Dmp::switchTo(const Dmp& other, const Vector3& goal, double ratio) noexcept {
  shape_ = other.shape_;
  tau_ = ratio * duration();
  mapShape(goal);
  phi_ = movingPoint(state_.phase);
}

Vector3 Dmp::movingPoint(double s) const noexcept {
  const Shape& shape = shape_;
  using Packet = Eigen::Array<double, kPacket, 1>;
  Eigen::Array<double, kMaxBasis, 1> exponent;
  exponent.head(shape.count) =
      -shape.widths.head(shape.count) * (s - shape.centres.head(shape.count)).square();
  // Relative to the nearest basis function, so that far from all of them the sum is still at least
  // one.
  const double nearest = exponent.head(shape.count).maxCoeff();
  Packet x = Packet::Zero(), y = Packet::Zero(), z = Packet::Zero(), sum = Packet::Zero();
  for (int i = 0; i < shape.count; i += kPacket) {
    const Packet relative = exponent.segment<kPacket>(i) - nearest;
    if (relative.maxCoeff() < kNegligible) continue;
    const Packet psi = relative.exp();
    sum += psi;
    x += psi * shape.weights.col(0).segment<kPacket>(i);
    y += psi * shape.weights.col(1).segment<kPacket>(i);
    z += psi * shape.weights.col(2).segment<kPacket>(i);
  }
  return shape_map_ * (Vector3(x.sum(), y.sum(), z.sum()) / sum.sum());
}

void Dmp::endAt(const Vector3& position) noexcept {
  state_ = {position, Vector3::Zero(), Vector3::Zero(), std::min(state_.phase, kEndPhase)};
  phi_ = movingPoint(state_.phase);
}

void Dmp::setRatio(double ratio) noexcept { tau_ = ratio * duration(); }

const DmpState& Dmp::step(double dt, const Vector3& goal, const Vector3& goal_velocity,
                          double rate) noexcept {
  const double total = dt * rate;
  if (!(total > 0.0)) return state_;
  // In motion time of a slowed clock the goal moves faster. The factor is at most 10.
  const Vector3 goal_rate = goal_velocity / std::max(rate, 0.1);
  const double pole = tau_ / std::max(std::sqrt(stiffness()), 0.5 * damping());
  const double longest = std::min(kPoleShare * pole, kBasisShare * tau_ / shape_.count);
  const int count = std::clamp(static_cast<int>(std::ceil(total / longest - 1e-9)), 1, 10000);
  const double h = total / count;
  Vector3 x = state_.position, v = tau_ * state_.velocity;
  const CanonicalSystem& canonical = shape_.canonical;
  const double half_decay = canonical.advance(1.0, 0.5 * h, tau_);
  double s = state_.phase;
  Vector3 f2 = Vector3::Zero();
  for (int i = 0; i < count; ++i) {
    const double s_half = s * half_decay, s_end = s_half * half_decay;
    const Vector3 phi_half = movingPoint(s_half), phi_end = movingPoint(s_end);
    const auto force = [&](double phase, const Vector3& phi, double elapsed) {
      const Vector3 goal_now = goal + goal_velocity * (elapsed / std::max(rate, 0.1));
      return forcing(goalWeight(phase), phi, start_, goal_now, goal_rate, tau_);
    };
    const Vector3 f0 = force(s, phi_, i * h), f1 = force(s_half, phi_half, (i + 0.5) * h);
    f2 = force(s_end, phi_end, (i + 1) * h);
    const Vector3 kx1 = v, kv1 = acceleration(f0, x, v);
    const double a = 0.5 * h / tau_, b = h / tau_;
    const Vector3 kx2 = v + a * kv1, kv2 = acceleration(f1, x + a * kx1, kx2);
    const Vector3 kx3 = v + a * kv2, kv3 = acceleration(f1, x + a * kx2, kx3);
    const Vector3 kx4 = v + b * kv3, kv4 = acceleration(f2, x + b * kx3, kx4);
    x += b / 6.0 * (kx1 + 2.0 * kx2 + 2.0 * kx3 + kx4);
    v += b / 6.0 * (kv1 + 2.0 * kv2 + 2.0 * kv3 + kv4);
    s = s_end;
    phi_ = phi_end;
  }
  state_.position = x;
  state_.velocity = v / tau_;
  state_.acceleration = acceleration(f2, x, v) / (tau_ * tau_);
  state_.phase = s;
  return state_;
}

double Dmp::progress() const noexcept {
  return std::min(1.0, shape_.canonical.timeAt(std::max(state_.phase, 1e-300), 1.0));
}

double Dmp::remainingTime() const noexcept { return (1.0 - progress()) * tau_; }

void requireRatio(double ratio) {
  if (ratio >= 0.05 && ratio <= 100.0) return;
  throw std::invalid_argument(
      "dmp_ratio: expected a number from 0.05 to 100 (1: duration of the demonstration), got " +
      std::to_string(ratio));
}

}  // namespace coglab_controllers
