#include "coglab_sim/plant/hand_motors.hpp"

#include <algorithm>
#include <cmath>

namespace coglab_sim::plant {
namespace {
// Last share of the tension limit, over which a motor slows down.
constexpr double kSlowing = 0.2;
// Share of the stroke at which a target counts as reached.
constexpr double kThere = 1e-6;
}  // namespace

void HandMotors::command(int motor, const MotorCommand& command) {
  const auto i = static_cast<std::size_t>(motor);
  MotorCommand& old = commands_[i];
  if (old.speed == command.speed && old.target == command.target && old.current == command.current)
    return;
  old = {std::clamp(command.speed, 0.0, 1.0), std::clamp(command.target, 0.0, 1.0),
         std::max(0.0, command.current)};
  states_[i].locked = false;
  slow_[i] = 0.0;
}

void HandMotors::set(int motor, double position) {
  const auto i = static_cast<std::size_t>(motor);
  states_[i] = MotorState{};
  states_[i].position = std::clamp(position, 0.0, 1.0);
  commands_[i] = {0.0, states_[i].position, 0.0};
  slow_[i] = 0.0;
}

double HandMotors::wound(int motor) const {
  const auto i = static_cast<std::size_t>(motor);
  return table_.motors[i].open_length + states_[i].position * table_.motors[i].stroke;
}

void HandMotors::step(const std::array<double, kMotors>& tension, double dt) {
  for (std::size_t i = 0; i < kMotors; ++i) {
    const MotorCommand& command = commands_[i];
    MotorState& state = states_[i];
    const double load = std::abs(tension[i]), limit = table_.motors[i].limit;
    state.tension = load;
    state.effort = table_.stall_current * load / limit;
    state.moving = false;
    state.current = 0.0;
    const double way = command.target - state.position;
    if (command.speed <= 0.0 || state.locked || std::abs(way) < kThere) continue;

    const double full = command.speed / table_.full_stroke;  // share of the stroke per second
    double rate = full;
    if (way > 0.0) {
      const double share = (command.current - table_.free_current) / table_.stall_current;
      const double stop = limit * std::clamp(share, 1e-6, 1.0);
      rate *= std::clamp((stop - load) / (kSlowing * stop), 0.0, 1.0);
    }
    state.position += std::copysign(std::min(std::abs(way), rate * dt), way);
    state.moving = rate > table_.lock_share * full;
    slow_[i] = state.moving ? 0.0 : slow_[i] + dt;
    state.locked = slow_[i] >= table_.lock_time;
    state.current = table_.free_current + table_.speed_current * rate * table_.full_stroke +
                    (way > 0.0 ? state.effort : 0.0);
  }
}

}  // namespace coglab_sim::plant
