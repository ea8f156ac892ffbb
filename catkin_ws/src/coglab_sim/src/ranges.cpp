#include "coglab_sim/ranges.hpp"

#include <sstream>
#include <stdexcept>

namespace coglab_sim {
namespace {

struct Row {
  const char* name;
  double low, high;
};

// Units are those of cellParameters(). For lists: of each number.
constexpr Row kRanges[] = {
    {"seed", 0, 2147483647},
    {"home", -3.2, 3.2},
    {"krc/period", 0.001, 0.1},
    {"krc/quality_perfect", 0, 1},
    {"krc/quality_ok", 0, 1},
    {"krc/quality_bad", 0, 1},
    {"krc/entry_quality", 1, 3},
    {"krc/extrapolated_packets", 0, 100},
    {"krc/entry_position_tolerance", 0, 0.1},
    {"krc/entry_frame_tolerance", 0, 1},
    {"krc/torque_tolerance", 0, 1000},
    {"krc/speed_limit", 1e-4, 50},
    {"krc/t1_speed_limit", 1e-4, 50},
    {"krc/speed_margin", 0, 1},
    {"krc/frame_speed_limit", 1e-4, 50},
    {"krc/frame_turn_limit", 1e-4, 50},
    {"krc/frame_orthonormality", 1e-6, 0.1},
    {"krc/position_limit", 0.1, 3.2},
    {"krc/torque_limit_time", 0, 600},
    {"krc/joint_stiffness_max", 0, 1e7},
    {"krc/frame_stiffness_max", 0, 1e7},
    {"krc/rotation_stiffness_max", 0, 1e7},
    {"krc/joint_stiffness", 0, 1e7},
    {"krc/frame_stiffness", 0, 1e7},
    {"krc/rotation_stiffness", 0, 1e7},
    {"krc/damping", 0, 1},
    {"krc/krl_poll", 0.001, 10},
    {"krc/krl_message_wait", 0, 600},
    {"krc/krl_drive_wait", 0, 600},
    {"krc/krl_quality_wait", 0, 600},
    {"krc/brake_release", 0, 600},
    {"krc/power_up", 0, 600},
    {"krc/close_linger", 0, 600},
    {"krc/ambient_temperature", -50, 200},
    {"krc/drive_heating", 0, 200},
    {"krc/drive_heating_time", 1, 1e6},
    {"krc/drive_warning", -50, 200},
    {"krc/payload_error", 0, 0.5},
    {"krc/inertia_error", 0, 0.5},
    {"arm/torque_limit", 1, 1000},
    {"arm/rotor_inertia", 0.01, 100},
    {"arm/coulomb_friction", 0, 1000},
    {"arm/friction_spread", 0, 1},
    {"arm/coulomb_speed", 1e-4, 50},
    {"arm/servo_bandwidth", 1, 500},
    {"arm/nullspace_stiffness", 0, 1e7},
    {"arm/block_stiffness", 0, 1e7},
    {"arm/brake_torque", 1, 1000},
    {"arm/unknown_load", 0, 10},
    {"torque_noise/sigma", 0, 1000},
    {"torque_noise/speed_gain", 0, 1000},
    {"torque_noise/correlation_time", 1e-4, 10},
    {"torque_noise/bias", 0, 1000},
    {"torque_noise/offset", 0, 1000},
    {"torque_noise/hysteresis", 0, 1000},
    {"torque_noise/hysteresis_speed", 1e-4, 50},
    {"object/mass", 0.01, 10},
    {"object/size", 1e-3, 2},
    {"object/center", -5, 5},
    {"object/friction", 0, 2},
    {"object/position", -5, 5},
    {"object/rotation", -1, 1},
    {"person/arm_bandwidth", 1e-4, 500},
    {"person/arm_force", 0, 1000},
    {"person/arm_torque", 0, 1000},
    {"person/grip_bandwidth", 1e-4, 500},
    {"person/grip_lever", 0, 1},
    {"contact/human_reach", 0, 1},
    {"contact/floor_height", -5, 5},
    {"contact/board_center", -5, 5},
    {"contact/board_size", 0, 5},
    // of the node
    {"fri_port", 0, 65535},
    {"fri_source_port", 0, 65535},
    {"port_wait", 0, 3600},
    {"rt_priority", 0, 98},
    {"speed", 0.01, 100},
    {"truth_rate", 1, 1000},
    // of faults
    {"fault/lose_packets", 0, 1e6},
    {"fault/packet_loss", 0, 1},
    {"fault/silence", 0, 1e6},
};

}  // namespace

Range rangeOf(const std::string& name) {
  for (const Row& row : kRanges) {
    if (name == row.name) return {row.low, row.high};
  }
  return {0.0, 0.0};
}

void requireWithin(const Range& range, const std::string& shown, double value) {
  if (range.holds(value)) return;
  std::ostringstream text;
  text << "parameter " << shown << " = " << value << " is outside its range " << range.low << ".."
       << range.high;
  throw std::invalid_argument(text.str());
}

void requireWithin(const std::string& name, double value) {
  requireWithin(rangeOf(name), name, value);
}

}  // namespace coglab_sim
