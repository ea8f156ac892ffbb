/// @file
/// Bounds on the output of a remote process: distance, speed and change of speed.
#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

namespace coglab_controllers {

/// Follows a target from another process, with bounds on speed and acceleration of each number. In
/// steady motion within the bounds it follows without lag. No allocation, no throw.
/// @tparam N count of numbers
template <int N>
class BoundedFollower {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;

  /// @param speed, acceleration of each number, unit/s and unit/s^2
  void setBounds(const Vector& speed, const Vector& acceleration) {
    speed_ = speed;
    acceleration_ = acceleration;
  }
  void begin(const Vector& at, const Vector& velocity) noexcept {
    at_ = next_ = at;
    velocity_ = velocity;
  }

  /// One cycle toward a moving target.
  void follow(const Vector& target, const Vector& velocity, double dt) noexcept {
    const Vector error = target - at_;
    Vector wanted;
    for (int i = 0; i < N; ++i) {
      // Largest speed toward the target from which half of the acceleration bound can brake.
      const double size = std::abs(error[i]);
      const double closing = std::min(size / (4.0 * dt), std::sqrt(acceleration_[i] * size));
      wanted[i] = velocity[i] + std::copysign(closing, error[i]);
    }
    step(wanted, dt);
  }
  /// One cycle of braking.
  void brake(double dt) noexcept { step(Vector::Zero(), dt); }

  const Vector& at() const noexcept { return at_; }              ///< now
  const Vector& next() const noexcept { return next_; }          ///< at the end of the cycle
  const Vector& velocity() const noexcept { return velocity_; }  ///< of this cycle
  /// Call it after follow() or brake(), when the numbers of the cycle have been used.
  void advance() noexcept { at_ = next_; }

 private:
  void step(const Vector& wanted, double dt) noexcept {
    const Vector change = dt * acceleration_;
    const Vector before = velocity_;
    velocity_ = wanted.cwiseMax(-speed_).cwiseMin(speed_);
    velocity_ = velocity_.cwiseMax(before - change).cwiseMin(before + change);
    next_ = at_ + dt * velocity_;
  }

  Vector speed_ = Vector::Ones(), acceleration_ = Vector::Ones();
  Vector at_ = Vector::Zero(), next_ = Vector::Zero(), velocity_ = Vector::Zero();
};

/// A correction of three numbers with a bounded norm and rate. Without answers it fades to exactly
/// zero within a fixed time. No allocation, no throw.
class BoundedCorrection {
 public:
  using Vector = Eigen::Vector3d;

  /// @param size largest norm  @param rate largest change per second  @param fade s; size / rate
  /// is at most this
  void setBounds(double size, double rate, double fade) noexcept {
    size_ = size;
    rate_ = rate;
    fade_ = fade;
  }
  /// Sets the correction to zero at once.
  void clear() noexcept { at_.setZero(), begun_ = false; }

  void follow(const Vector& wanted, double dt) noexcept {
    begun_ = false;
    move(within(wanted, size_), rate_ * dt);
  }
  /// One cycle without an answer: moves along a straight line to zero.
  void fade(double dt) noexcept {
    if (!begun_) slope_ = at_.norm() / fade_;
    begun_ = true;
    move(Vector::Zero(), slope_ * dt);
    if (at_.norm() < 1e-9) at_.setZero();
  }
  const Vector& at() const noexcept { return at_; }

 private:
  static Vector within(const Vector& vector, double size) noexcept {
    const double norm = vector.norm();
    return norm > size ? Vector(size / norm * vector) : vector;
  }
  void move(const Vector& target, double most) noexcept { at_ += within(target - at_, most); }

  double size_ = 0.0, rate_ = 0.0, fade_ = 1.0, slope_ = 0.0;
  bool begun_ = false;
  Vector at_ = Vector::Zero();
};

}  // namespace coglab_controllers
