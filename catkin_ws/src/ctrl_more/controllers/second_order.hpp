#pragma once

#include <cmath>

#include <Eigen/Core>

namespace ctrl_more {

/// Mass, damper and spring, M x'' + D x' + K x = f. The step is exact for a force that is constant
/// during the step (zero-order hold): there is no discretisation error at the samples, for any step
/// and stiffness. Units of one axis: M [kg], D [N s/m], K [N/m], or their rotational counterparts.
class SecondOrder {
 public:
  /// Prepares a step. No allocation.
  /// @param mass > 0
  /// @param damping >= 0
  /// @param stiffness >= 0; 0: no spring, the mass stays at its last position
  /// @param dt step [s], > 0
  void prepare(double mass, double damping, double stiffness, double dt) {
    if (mass == mass_ && damping == damping_ && stiffness == stiffness_ && dt == dt_) return;
    mass_ = mass;
    damping_ = damping;
    stiffness_ = stiffness;
    dt_ = dt;
    const double a = 0.5 * damping / mass;
    const double w2 = stiffness / mass;
    const double discriminant = a * a - w2;
    double c = 0.0;  // exp(-a t) cosh(s t), or cos
    double s = 0.0;  // exp(-a t) sinh(s t) / s, or sin
    if (std::abs(discriminant) * dt * dt < 1e-12) {
      const double decay = std::exp(-a * dt);
      c = decay * (1.0 + 0.5 * discriminant * dt * dt);
      s = decay * dt * (1.0 + discriminant * dt * dt / 6.0);
    } else if (discriminant > 0.0) {
      const double root = std::sqrt(discriminant);
      const double slow = std::exp(-w2 / (a + root) * dt);  // a - root without cancellation
      const double fast = std::exp(-(a + root) * dt);
      c = 0.5 * (slow + fast);
      s = 0.5 * (slow - fast) / root;
    } else {
      const double root = std::sqrt(-discriminant);
      const double decay = std::exp(-a * dt);
      c = decay * std::cos(root * dt);
      s = decay * std::sin(root * dt) / root;
    }
    xx_ = c + a * s;
    xv_ = s;
    vx_ = -w2 * s;
    vv_ = c - a * s;
    vf_ = s / mass;
    if (stiffness > 0.0) {
      xf_ = (1.0 - xx_) / stiffness;
    } else if (damping > 0.0) {
      xf_ = (dt + std::expm1(-damping / mass * dt) * mass / damping) / damping;
    } else {
      xf_ = 0.5 * dt * dt / mass;
    }
  }

  /// Makes one step.
  /// @param force constant during the step
  /// @param x position, in and out
  /// @param v velocity, in and out
  void step(double force, double& x, double& v) const {
    const double next = xx_ * x + xv_ * v + xf_ * force;
    v = vx_ * x + vv_ * v + vf_ * force;
    x = next;
  }

 private:
  double mass_ = 0.0, damping_ = 0.0, stiffness_ = 0.0, dt_ = 0.0;
  double xx_ = 1.0, xv_ = 0.0, vx_ = 0.0, vv_ = 1.0, xf_ = 0.0, vf_ = 0.0;
};

/// N independent axes.
template <int N>
class SecondOrderAxes {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;
  /// Makes one step of `dt`; positions and velocities are changed.
  void step(const Vector& mass, const Vector& damping, const Vector& stiffness, double dt,
            const Vector& force, Eigen::Ref<Vector> positions, Eigen::Ref<Vector> velocities) {
    for (int i = 0; i < N; ++i) {
      axes_[i].prepare(mass[i], damping[i], stiffness[i], dt);
      axes_[i].step(force[i], positions[i], velocities[i]);
    }
  }

 private:
  SecondOrder axes_[N];
};

}  // namespace ctrl_more
