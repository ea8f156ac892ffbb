#include "coglab_sim/cell_config.hpp"

#include <cmath>
#include <stdexcept>

#include "coglab_sim/krc/krl_program.hpp"
#include "coglab_sim/ranges.hpp"

namespace coglab_sim {
namespace {

[[noreturn]] void refuse(const std::string& name, const std::string& expected) {
  throw std::invalid_argument("parameter " + name + ": expected " + expected);
}

double numberOf(const std::string& name, const ParameterValue& value, const Range& range) {
  double number = 0.0;
  if (const auto* given = std::get_if<double>(&value)) {
    number = *given;
  } else if (const auto* whole = std::get_if<int>(&value)) {
    number = *whole;
  } else {
    refuse(name, "a number");
  }
  requireWithin(range, name, number);
  return number;
}

template <typename Vector>
Vector vectorOf(const std::string& name, const ParameterValue& value, std::size_t size,
                const Range& range) {
  const auto* list = std::get_if<std::vector<double>>(&value);
  if (list == nullptr || list->size() != size)
    refuse(name, "a list of " + std::to_string(size) + " numbers");
  Vector result;
  for (std::size_t i = 0; i < size; ++i) {
    requireWithin(range, name + "[" + std::to_string(i) + "]", (*list)[i]);
    result[static_cast<Eigen::Index>(i)] = (*list)[i];
  }
  return result;
}

std::string stringOf(const std::string& name, const ParameterValue& value) {
  const auto* text = std::get_if<std::string>(&value);
  if (text == nullptr) refuse(name, "a text");
  return *text;
}

// How each type of field is read and written. `Access` returns a reference to the field.
template <typename Access>
ParameterValue read(const CellConfig& config, Access access) {
  auto& field = access(const_cast<CellConfig&>(config));
  using Field = std::decay_t<decltype(field)>;
  if constexpr (std::is_same_v<Field, Vector7> || std::is_same_v<Field, Vector3d>) {
    return std::vector<double>(field.data(), field.data() + field.size());
  } else if constexpr (std::is_same_v<Field, Quaterniond>) {
    return std::vector<double>{field.x(), field.y(), field.z(), field.w()};
  } else if constexpr (std::is_same_v<Field, std::uint64_t>) {
    return static_cast<int>(field);
  } else {
    return field;
  }
}

template <typename Access>
void write(CellConfig& config, const std::string& name, const Range& range,
           const ParameterValue& value, Access access) {
  auto& field = access(config);
  using Field = std::decay_t<decltype(field)>;
  if constexpr (std::is_same_v<Field, Vector7>) {
    field = vectorOf<Vector7>(name, value, 7, range);
  } else if constexpr (std::is_same_v<Field, Vector3d>) {
    field = vectorOf<Vector3d>(name, value, 3, range);
  } else if constexpr (std::is_same_v<Field, Quaterniond>) {
    const auto q = vectorOf<Eigen::Vector4d>(name, value, 4, range);
    if (std::abs(q.norm() - 1.0) > 1e-3) refuse(name, "a quaternion x y z w of length 1");
    field = Quaterniond(q[3], q[0], q[1], q[2]).normalized();
  } else if constexpr (std::is_same_v<Field, std::string>) {
    field = stringOf(name, value);
  } else if constexpr (std::is_same_v<Field, bool>) {
    const auto* flag = std::get_if<bool>(&value);
    if (flag == nullptr) refuse(name, "true or false");
    field = *flag;
  } else {
    field = static_cast<Field>(numberOf(name, value, range));
  }
}

template <typename Access>
CellParameter row(const char* name, const char* unit, const char* source, const char* description,
                  Access access) {
  const Range range = rangeOf(name);
  return {name,
          unit,
          source,
          description,
          range.low,
          range.high,
          [access](const CellConfig& config) { return read(config, access); },
          [access, name, range](CellConfig& config, const ParameterValue& value) {
            write(config, name, range, value, access);
          }};
}

const char* modeName(krc::OperatingMode mode) {
  switch (mode) {
    case krc::OperatingMode::T1:
      return "T1";
    case krc::OperatingMode::T2:
      return "T2";
    case krc::OperatingMode::Automatic:
      break;
  }
  return "AUT";
}

CellParameter conventionRow() {
  return {
      "krc/convention",
      "",
      "set-up",
      "KRL program: coglab, centro_epiaggio, stanford, rcprg_tum, rtt_lwr, openkc, kuka_sample",
      0.0,
      0.0,
      [](const CellConfig& config) { return ParameterValue(krc::nameOf(config.krc.convention)); },
      [](CellConfig& config, const ParameterValue& value) {
        config.krc.convention = krc::krlConventionOf(stringOf("krc/convention", value));
      }};
}

CellParameter modeRow() {
  return {"krc/mode",
          "",
          "set-up",
          "operating mode: T1, T2, AUT",
          0.0,
          0.0,
          [](const CellConfig& config) {
            return ParameterValue(std::string(modeName(config.krc.mode)));
          },
          [](CellConfig& config, const ParameterValue& value) {
            const std::string name = stringOf("krc/mode", value);
            for (const auto mode :
                 {krc::OperatingMode::T1, krc::OperatingMode::T2, krc::OperatingMode::Automatic}) {
              if (name != modeName(mode)) continue;
              config.krc.mode = mode;
              return;
            }
            refuse("krc/mode", "T1, T2 or AUT, got " + name);
          }};
}

#define ROW(name, unit, source, description, field) \
  row(                                              \
      name, unit, source, description, [](CellConfig & c) -> auto& { return c.field; })

std::vector<CellParameter> makeTable() {
  return {
      ROW("urdf", "", "set-up", "path of the robot description", urdf),
      ROW("seed", "", "set-up", "of all random numbers", seed),
      ROW("home", "rad", "set-up", "joint positions at the start, wire order", home),
      ROW("krc/period", "s", "set-up", "FRI period", krc.period),
      conventionRow(),
      modeRow(),
      ROW("krc/quality_perfect", "1", "ours", "share of the last 100 packets answered for PERFECT",
          krc.quality_perfect),
      ROW("krc/quality_ok", "1", "ours", "the same for OK", krc.quality_ok),
      ROW("krc/quality_bad", "1", "ours", "the same for BAD; below: UNACCEPTABLE", krc.quality_bad),
      ROW("krc/entry_quality", "", "ours",
          "lowest quality (1 BAD .. 3 PERFECT) with which friStart succeeds", krc.entry_quality),
      ROW("krc/extrapolated_packets", "", "ours", "successive losses bridged by extrapolation",
          krc.extrapolated_packets),
      ROW("krc/entry_position_tolerance", "rad", "ours", "command against set-point on entry",
          krc.entry_position_tolerance),
      ROW("krc/entry_frame_tolerance", "m, rad", "ours", "the same for a Cartesian command",
          krc.entry_frame_tolerance),
      ROW("krc/torque_tolerance", "Nm", "ours",
          "added torque on entry and per step (users report about 1)", krc.torque_tolerance),
      ROW("krc/speed_limit", "rad/s", "published", "per joint, KRC file rsidef7.dat",
          krc.speed_limit),
      ROW("krc/t1_speed_limit", "rad/s", "published", "per joint in T1, CentroEPiaggio",
          krc.t1_speed_limit),
      ROW("krc/speed_margin", "1", "ours", "share by which a step may exceed limit x period",
          krc.speed_margin),
      ROW("krc/frame_speed_limit", "m/s", "ours", "of a commanded frame", krc.frame_speed_limit),
      ROW("krc/frame_turn_limit", "rad/s", "ours", "of a commanded frame", krc.frame_turn_limit),
      ROW("krc/frame_orthonormality", "1", "ours",
          "by which a commanded rotation matrix may fail to be one", krc.frame_orthonormality),
      ROW("krc/position_limit", "rad", "published", "mechanical range, both directions",
          krc.position_limit),
      ROW("krc/torque_limit_time", "s", "ours",
          "full motor torque for so long switches the drives off", krc.torque_limit_time),
      ROW("krc/joint_stiffness_max", "Nm/rad", "ours", "largest accepted", krc.joint_stiffness_max),
      ROW("krc/frame_stiffness_max", "N/m", "ours", "largest accepted", krc.frame_stiffness_max),
      ROW("krc/rotation_stiffness_max", "Nm/rad", "ours", "largest accepted",
          krc.rotation_stiffness_max),
      ROW("krc/joint_stiffness", "Nm/rad", "published", "default of $STIFFNESS as clients set it",
          krc.joint_stiffness),
      ROW("krc/frame_stiffness", "N/m", "published", "the same, translations", krc.frame_stiffness),
      ROW("krc/rotation_stiffness", "Nm/rad", "published", "the same, rotations",
          krc.rotation_stiffness),
      ROW("krc/damping", "1", "published", "the same, normalised damping", krc.damping),
      ROW("krc/krl_poll", "s", "published",
          "between two looks of the KRL program at the exchange arrays", krc.krl_poll),
      ROW("krc/krl_message_wait", "s", "published", "a program waits when it shows a message",
          krc.krl_message_wait),
      ROW("krc/krl_drive_wait", "s", "ours", "a program waits for drives and brakes",
          krc.krl_drive_wait),
      ROW("krc/krl_quality_wait", "s", "ours", "a program waits for the quality",
          krc.krl_quality_wait),
      ROW("krc/brake_release", "s", "ours", "duration of the tiny motion that opens the brakes",
          krc.brake_release),
      ROW("krc/power_up", "s", "ours", "from acknowledging to full drive power", krc.power_up),
      ROW("krc/close_linger", "s", "ours", "measurements go on for so long after friClose",
          krc.close_linger),
      ROW("krc/acknowledge_by_program", "", "ours", "false: messages wait for an operator",
          krc.acknowledge_by_program),
      ROW("krc/ambient_temperature", "degree Celsius", "ours", "of the drives at the start",
          krc.ambient_temperature),
      ROW("krc/drive_heating", "K", "ours", "of a drive above that at full torque, in the end",
          krc.drive_heating),
      ROW("krc/drive_heating_time", "s", "ours", "time constant of it", krc.drive_heating_time),
      ROW("krc/drive_warning", "degree Celsius", "ours", "from which a drive warns",
          krc.drive_warning),
      ROW("krc/payload_error", "1", "ours", "largest share by which the hand's mass is wrong",
          servos.payload_error),
      ROW("krc/inertia_error", "1", "ours", "largest share by which an inertia is wrong",
          servos.inertia_error),
      ROW("hand_model", "", "set-up",
          "path of another table of the hand; empty: config/hand_model.yaml", hand_model),
      ROW("arm/torque_limit", "Nm", "published", "of the motors at the joint", servos.torque_limit),
      ROW("arm/rotor_inertia", "kg m^2", "ours", "reflected to the joint", drives.rotor_inertia),
      ROW("arm/coulomb_friction", "Nm", "ours", "per joint; the viscous part comes from the URDF",
          drives.coulomb_friction),
      ROW("arm/friction_spread", "1", "ours",
          "largest share by which the Coulomb friction of a joint differs from that",
          drives.friction_spread),
      ROW("arm/coulomb_speed", "rad/s", "ours", "over which Coulomb friction reverses",
          drives.coulomb_speed),
      ROW("arm/servo_bandwidth", "rad/s", "ours", "of the position servo, critically damped",
          servos.bandwidth),
      ROW("arm/nullspace_stiffness", "Nm/rad", "ours", "of the posture in Cartesian impedance",
          servos.nullspace_stiffness),
      ROW("arm/block_stiffness", "Nm/rad", "ours", "of whatever holds a blocked arm",
          drives.block_stiffness),
      ROW("arm/brake_torque", "Nm", "ours", "of the brakes at the joint", drives.brake_torque),
      ROW("arm/unknown_load", "kg", "ours", "at the palm, not in the controller's load data",
          drives.unknown_load),
      ROW("torque_noise/sigma", "Nm", "ours", "0.05 good sensors, 0.15 bad ones",
          torque_noise.sigma),
      ROW("torque_noise/speed_gain", "s/rad", "ours", "growth of the noise with joint speed",
          torque_noise.speed_gain),
      ROW("torque_noise/correlation_time", "s", "ours", "of the AR(1) noise",
          torque_noise.correlation_time),
      ROW("torque_noise/bias", "Nm", "ours", "amplitude of the posture-dependent offset",
          torque_noise.bias),
      ROW("torque_noise/offset", "Nm", "ours", "largest of the constant offsets, drawn per joint",
          torque_noise.offset),
      ROW("torque_noise/hysteresis", "Nm", "ours", "of the external torque estimate",
          torque_noise.hysteresis),
      ROW("torque_noise/hysteresis_speed", "rad/s", "ours", "over which it reverses",
          torque_noise.hysteresis_speed),
      ROW("object/id", "", "set-up", "name of the object", object.id),
      ROW("object/mass", "kg", "set-up", "of the object", object.mass),
      ROW("object/shape", "", "set-up", "box, cylinder or sphere", object.shape),
      ROW("object/size", "m", "set-up", "along x y z of the object frame", object.size),
      ROW("object/center", "m", "set-up", "centre of mass in the object frame", object.center),
      ROW("object/friction", "1", "set-up", "against hands and planes", object.friction),
      ROW("object/start", "", "set-up", "human_hand, robot_hand or world", object_start),
      ROW("object/position", "m", "set-up", "of the object in that frame", object_pose.position),
      ROW("object/rotation", "1", "set-up", "of the object in that frame, quaternion x y z w",
          object_pose.rotation),
      ROW("person/arm_bandwidth", "rad/s", "ours", "of the hold of the person's own hand",
          person.arm.bandwidth),
      ROW("person/arm_force", "N", "ours", "by which the person pushes at most", person.arm.force),
      ROW("person/arm_torque", "Nm", "ours", "the same, turning", person.arm.torque),
      ROW("person/grip_bandwidth", "rad/s", "ours", "of the person's grip on the object",
          person.grip_bandwidth),
      ROW("person/grip_lever", "m", "ours", "torque of that grip over its force",
          person.grip_lever),
      ROW("contact/human_reach", "m", "ours",
          "hand to surface at which the person's grip finds the object", person.reach),
      ROW("contact/floor_height", "m", "set-up", "world z", surroundings.floor_height),
      ROW("contact/board_center", "m", "set-up", "middle of the board's upper side in the world",
          surroundings.board_center),
      ROW("contact/board_size", "m", "set-up", "along world x y; 0: no board",
          surroundings.board_size),
  };
}

#undef ROW

}  // namespace

const std::vector<CellParameter>& cellParameters() {
  static const std::vector<CellParameter> table = makeTable();
  return table;
}

void setCellParameter(CellConfig& config, const std::string& name, const ParameterValue& value) {
  for (const auto& parameter : cellParameters()) {
    if (parameter.name != name) continue;
    parameter.set(config, value);
    return;
  }
  throw std::invalid_argument("the simulated cell has no parameter '" + name + "'");
}

}  // namespace coglab_sim
