#include "coglab_controllers/ptp/ptp_trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace coglab_controllers {
namespace {

// Distance of a ramp of length `duration` that changes from `velocity` to `cruise`, holds it, and
// brakes to rest.
double wayOf(double velocity, double cruise, double acceleration, double duration) {
  const double up = std::abs(cruise - velocity) / acceleration,
               down = std::abs(cruise) / acceleration;
  return 0.5 * (velocity + cruise) * up + cruise * (duration - up - down) + 0.5 * cruise * down;
}

}  // namespace

PtpTrajectory::PtpTrajectory(const JointVector& position, const JointVector& velocity,
                             const JointVector& target, const JointVector& max_velocity,
                             const JointVector& max_acceleration, int joints) {
  if (joints < 1 || joints > kMaxJoints) {
    throw std::invalid_argument("joints: expected 1 to " + std::to_string(kMaxJoints) + ", got " +
                                std::to_string(joints));
  }
  const auto require = [](const char* name, int joint, double value, double low, double high,
                          const char* expected) {
    if (value >= low && value <= high) return;
    throw std::invalid_argument(std::string(name) + "[" + std::to_string(joint) + "]: expected " +
                                expected + ", got " + std::to_string(value));
  };
  target_ = position;
  target_.head(joints) = target.head(joints);
  for (int i = 0; i < joints; ++i) {
    require("position", i, position[i], -100.0, 100.0, "a finite angle in rad");
    require("velocity", i, velocity[i], -100.0, 100.0, "a finite velocity in rad/s");
    require("target", i, target[i], -100.0, 100.0, "a finite angle in rad");
    require("max_vel", i, max_velocity[i], 1e-4, 100.0, "a positive velocity in rad/s");
    require("max_acc", i, max_acceleration[i], 1e-4, 1e4, "a positive acceleration in rad/s^2");
  }
  const bool from_rest = velocity.head(joints).isZero(0.0);
  if (from_rest) {
    // One profile along a straight line, scaled to each joint.
    double speed = std::numeric_limits<double>::infinity(), acceleration = speed;
    for (int i = 0; i < joints; ++i) {
      const double distance = std::abs(target[i] - position[i]);
      if (distance < 1e-12) continue;
      speed = std::min(speed, max_velocity[i] / distance);
      acceleration = std::min(acceleration, max_acceleration[i] / distance);
    }
    if (std::isfinite(speed)) {
      const Ramp line = fastest(1.0, 0.0, speed, acceleration);
      duration_ = line.accelerate_time + line.cruise_time + line.brake_time;
      for (int i = 0; i < joints; ++i) {
        const double distance = target[i] - position[i];
        ramps_[i] = line;
        ramps_[i].start = position[i];
        ramps_[i].cruise = distance * line.cruise;
        ramps_[i].acceleration = std::max(std::abs(distance) * line.acceleration, 1e-300);
      }
    }
  } else {
    for (int i = 0; i < joints; ++i) {
      const Ramp ramp =
          fastest(target[i] - position[i], velocity[i], max_velocity[i], max_acceleration[i]);
      duration_ = std::max(duration_, ramp.accelerate_time + ramp.cruise_time + ramp.brake_time);
    }
    for (int i = 0; i < joints; ++i) {
      ramps_[i] = stretched(target[i] - position[i], velocity[i], max_acceleration[i], duration_);
      ramps_[i].start = position[i];
      ramps_[i].velocity = velocity[i];
    }
  }
  for (int i = 0; i < kMaxJoints; ++i) {
    if (i >= joints || duration_ == 0.0) ramps_[i].start = position[i];
  }
}

PtpTrajectory::Ramp PtpTrajectory::fastest(double distance, double velocity, double max_velocity,
                                           double max_acceleration) {
  const double a = max_acceleration;
  // End of braking at once. Accelerate in the direction from there to the target.
  const double stop = 0.5 * velocity * std::abs(velocity) / a;
  const double direction = distance >= stop ? 1.0 : -1.0;
  // Highest speed of a ramp without cruise: 2 p^2 = v^2 + 2 a d, all along that direction.
  const double v = direction * velocity, d = direction * distance;
  const double peak = std::sqrt(std::max(0.0, 0.5 * v * v + a * d));
  const double cruise = std::min(peak, max_velocity);
  Ramp ramp;
  ramp.velocity = velocity;
  ramp.acceleration = a;
  ramp.cruise = direction * cruise;
  ramp.accelerate_time = std::abs(cruise - v) / a;
  ramp.brake_time = cruise / a;
  const double ramps = 0.5 * (v + cruise) * ramp.accelerate_time + 0.5 * cruise * ramp.brake_time;
  ramp.cruise_time = cruise > 0.0 ? std::max(0.0, (d - ramps) / cruise) : 0.0;
  return ramp;
}

PtpTrajectory::Ramp PtpTrajectory::stretched(double distance, double velocity, double acceleration,
                                             double duration) {
  // The distance increases with the cruising speed, so bisection finds the right speed.
  double low = 0.5 * (velocity - acceleration * duration),
         high = 0.5 * (velocity + acceleration * duration);
  for (int i = 0; i < 200 && high - low > 0.0; ++i) {
    const double middle = 0.5 * (low + high);
    if (middle == low || middle == high) break;
    (wayOf(velocity, middle, acceleration, duration) < distance ? low : high) = middle;
  }
  Ramp ramp;
  ramp.velocity = velocity;
  ramp.acceleration = acceleration;
  ramp.cruise = 0.5 * (low + high);
  ramp.accelerate_time = std::abs(ramp.cruise - velocity) / acceleration;
  ramp.brake_time = std::abs(ramp.cruise) / acceleration;
  ramp.cruise_time = std::max(0.0, duration - ramp.accelerate_time - ramp.brake_time);
  return ramp;
}

void PtpTrajectory::at(double t, PtpPoint& point) const noexcept {
  point.velocity.setZero();
  point.acceleration.setZero();
  if (!(t < duration_)) {
    point.position = target_;
    return;
  }
  t = std::max(t, 0.0);
  for (int i = 0; i < kMaxJoints; ++i) {
    const Ramp& ramp = ramps_[i];
    const double up = std::copysign(ramp.acceleration, ramp.cruise - ramp.velocity);
    const double down = std::copysign(ramp.acceleration, -ramp.cruise);
    const double first = ramp.accelerate_time, second = first + ramp.cruise_time;
    if (t < first) {
      point.position[i] = ramp.start + t * (ramp.velocity + 0.5 * up * t);
      point.velocity[i] = ramp.velocity + up * t;
      point.acceleration[i] = up;
    } else if (t < second) {
      point.position[i] =
          ramp.start + 0.5 * first * (ramp.velocity + ramp.cruise) + (t - first) * ramp.cruise;
      point.velocity[i] = ramp.cruise;
    } else if (t < second + ramp.brake_time) {
      // Computed backwards from the end, so that the motion ends exactly at the target.
      const double left = second + ramp.brake_time - t;
      point.position[i] = target_[i] + 0.5 * down * left * left;
      point.velocity[i] = -down * left;
      point.acceleration[i] = down;
    } else {
      point.position[i] = target_[i];
    }
  }
}

}  // namespace coglab_controllers
