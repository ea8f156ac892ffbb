#include "coglab_sim/torque_sensor.hpp"

#include <cmath>

namespace coglab_sim {

TorqueSensor::TorqueSensor(const TorqueNoise& noise, std::uint64_t seed)
    : noise_(noise), random_(seed, 1) {
  for (int i = 0; i < 7; ++i) {
    bias_phase_[i] = 2.0 * M_PI * random_.uniform();
    bias_rate_[i] = 0.5 + random_.uniform();
  }
  Random offsets(seed, 3);
  for (double& offset : offset_) offset = noise.offset * (2.0 * offsets.uniform() - 1.0);
}

void TorqueSensor::advance(const Vector7& velocity, double dt) {
  const double keep = std::exp(-dt / noise_.correlation_time);
  const double fresh = std::sqrt(1.0 - keep * keep) * noise_.sigma *
                       (1.0 + noise_.speed_gain * velocity.cwiseAbs().maxCoeff());
  for (int i = 0; i < 7; ++i) {
    measured_noise_[i] = keep * measured_noise_[i] + fresh * random_.normal();
    external_noise_[i] = keep * external_noise_[i] + fresh * random_.normal();
    // Hysteresis: the sign of the last movement stays when the joint stops.
    const double drive = velocity[i] / noise_.hysteresis_speed;
    const double target = std::tanh(drive);
    friction_[i] += (target - friction_[i]) * std::fmin(1.0, std::abs(drive));
  }
}

Vector7 TorqueSensor::external(const Vector7& ideal, const Vector7& position) const {
  Vector7 bias;
  for (int i = 0; i < 7; ++i)
    bias[i] = noise_.bias * std::sin(bias_rate_[i] * position[i] + bias_phase_[i]);
  return ideal - offset_ + bias + noise_.hysteresis * friction_ + external_noise_;
}

}  // namespace coglab_sim
