/// @file
/// The two datagrams of KUKA's Fast Research Interface. Only this file contains their layout.
///
/// The robot controller (KRC) sends one measurement per cycle. The PC answers each with one
/// command. Both are little endian with IEEE-754 float32 and natural alignment, which here equals
/// the packed layout. Every offset and size is asserted at compile time. Joint arrays are in wire
/// order A1 A2 E1 A3 A4 A5 A6. A frame is 3x4, row major (r11 r12 r13 px r21 r22 r23 py r31 r32 r33
/// pz), m. Cartesian vectors have reversed rotations: x y z Rz Ry Rx. Use `wrenchFromWire()` and
/// `wrenchToWire()`; never index the last three directly.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "lwr_fri_bridge/names.hpp"

namespace lwr_fri_bridge::fri {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "the datagrams are copied as they lie in memory");

constexpr std::size_t kJoints = 7;
constexpr std::size_t kUserValues = 16;   ///< length of the arrays exchanged with the KRL program
constexpr std::size_t kFrameValues = 12;  ///< 3x4 frame
constexpr std::size_t kCartesian = 6;     ///< x y z Rz Ry Rx

constexpr std::uint16_t kMeasurementId = 0x2006;
constexpr std::uint16_t kCommandId = 0x1005;
constexpr std::uint16_t kAllDrivesOn = 0x7F;  ///< `power` with one bit per joint
/// True if all seven drives have power. Some controllers also set higher bits.
constexpr bool allDrivesOn(std::uint16_t power) { return (power & kAllDrivesOn) == kAllDrivesOn; }
constexpr std::uint16_t kDefaultPort = 49938;

/// `state` of a measurement.
enum class FriState : std::uint16_t { Off = 0, Monitor = 1, Command = 2 };

/// `quality` of a measurement; commanding is possible from Bad upwards.
enum class Quality : std::uint16_t { Unacceptable = 0, Bad = 1, Ok = 2, Perfect = 3 };

/// `control` of a measurement; KRL's `$STIFFNESS.STRATEGY` is ten times the number.
enum class ControlStrategy : std::uint16_t {
  Other = 0,
  Position = 1,
  CartesianImpedance = 2,
  JointImpedance = 3
};

/// Bits of `flags` in a command. They select the fields that the controller uses, and may change
/// only in monitor mode.
enum CommandFlag : std::uint32_t {
  kJointPosition = 0x0001,
  kJointVelocity = 0x0002,  ///< reserved, not supported by any controller
  kJointTorque = 0x0004,
  kJointStiffness = 0x0010,
  kJointDamping = 0x0020,
  kCartesianPosition = 0x0100,
  kCartesianVelocity = 0x0200,  ///< reserved, not supported by any controller
  kCartesianForce = 0x0400,
  kCartesianStiffness = 0x1000,
  kCartesianDamping = 0x2000
};

/// Flags of a strategy, as existing clients set them (Other: none).
constexpr std::uint32_t flagsFor(ControlStrategy strategy) {
  switch (strategy) {
    case ControlStrategy::Position:
      return kJointPosition;
    case ControlStrategy::JointImpedance:
      return kJointPosition | kJointTorque | kJointStiffness | kJointDamping;
    case ControlStrategy::CartesianImpedance:
      return kCartesianPosition | kCartesianForce | kCartesianStiffness | kCartesianDamping;
    case ControlStrategy::Other:
      break;
  }
  return 0;
}

/// First eight bytes of both datagrams.
struct Header {
  std::uint16_t counter;    ///< +1 per datagram of this sender, wraps to 0
  std::uint16_t reflected;  ///< counter of the last datagram received from the other side
  std::uint16_t size;       ///< of the whole datagram, bytes
  std::uint16_t id;         ///< kMeasurementId or kCommandId
};

/// Values that the KRL program and the PC exchange. Both directions have the same layout.
struct UserData {
  float reals[kUserValues];        ///< `$FRI_TO_REA[i+1]` or `$FRI_FRM_REA[i+1]`
  std::int32_t ints[kUserValues];  ///< `$FRI_TO_INT[i+1]` or `$FRI_FRM_INT[i+1]`
  std::uint16_t bools;             ///< bit i: `$FRI_TO_BOOL[i+1]` or `$FRI_FRM_BOOL[i+1]`
  std::uint16_t padding;           ///< 0
};

/// Robot controller -> PC.
struct MeasurementDatagram {
  Header header;
  UserData krl;
  float timestamp;              ///< controller's clock, s; float32 loses milliseconds after hours
  std::uint16_t state;          ///< FriState
  std::uint16_t quality;        ///< Quality
  float measurement_period;     ///< desired, s
  float command_period;         ///< desired, s
  float safety_scale;           ///< argument of `friStart(x)`, 0..1
  float answer_rate;            ///< mean of the last 100 packets, ideal 1
  float latency;                ///< mean round trip, s
  float jitter;                 ///< mean, s
  float miss_rate;              ///< mean
  std::uint32_t miss_counter;   ///< missed answers since the connection was opened
  std::uint16_t power;          ///< drive power, one bit per joint in the lowest seven
  std::uint16_t control;        ///< ControlStrategy
  std::uint16_t drive_error;    ///< one bit per joint; leads to power off
  std::uint16_t drive_warning;  ///< one bit per joint
  float temperature[kJoints];   ///< of the drives, degree Celsius
  float measured_position[kJoints];            ///< rad
  float measured_frame[kFrameValues];          ///< m
  float commanded_position[kJoints];           ///< KRC's own interpolator, before FRI, rad
  float commanded_position_offset[kJoints];    ///< added by FRI; set-point = sum of both, rad
  float commanded_frame[kFrameValues];         ///< before FRI, m
  float commanded_frame_offset[kFrameValues];  ///< the frame due to FRI, m
  float measured_torque[kJoints];              ///< Nm
  float external_torque[kJoints];              ///< estimated, Nm
  float external_wrench[kCartesian];     ///< estimated at the tool: Fx Fy Fz Tz Ty Tx, N and Nm
  float jacobian[kCartesian * kJoints];  ///< row major, rows X Y Z RZ RY RX
  float mass_matrix[kJoints * kJoints];  ///< row major, kg m^2
  float gravity[kJoints];                ///< used as joint gravity torque, Nm
};

/// PC -> robot controller.
struct CommandDatagram {
  Header header;
  UserData krl;
  std::uint32_t flags;                    ///< CommandFlag bits
  float joint_position[kJoints];          ///< rad
  float cartesian_frame[kFrameValues];    ///< m
  float joint_torque[kJoints];            ///< added, Nm
  float cartesian_force[kCartesian];      ///< added: Fx Fy Fz Tz Ty Tx, N and Nm
  float joint_stiffness[kJoints];         ///< Nm/rad
  float joint_damping[kJoints];           ///< normalised, 0..1
  float cartesian_stiffness[kCartesian];  ///< x y z (N/m) Rz Ry Rx (Nm/rad)
  float cartesian_damping[kCartesian];    ///< normalised, same order
};

constexpr std::size_t kMeasurementSize = 916;
constexpr std::size_t kCommandSize = 376;

#define LWR_FRI_FIELD(type, field, offset, bytes)                                             \
  static_assert(offsetof(type, field) == (offset), #type "." #field " is at a wrong offset"); \
  static_assert(sizeof(type::field) == (bytes), #type "." #field " has a wrong size")

LWR_FRI_FIELD(Header, counter, 0, 2);
LWR_FRI_FIELD(Header, reflected, 2, 2);
LWR_FRI_FIELD(Header, size, 4, 2);
LWR_FRI_FIELD(Header, id, 6, 2);
LWR_FRI_FIELD(UserData, reals, 0, 64);
LWR_FRI_FIELD(UserData, ints, 64, 64);
LWR_FRI_FIELD(UserData, bools, 128, 2);
LWR_FRI_FIELD(UserData, padding, 130, 2);

LWR_FRI_FIELD(MeasurementDatagram, header, 0, 8);
LWR_FRI_FIELD(MeasurementDatagram, krl, 8, 132);
LWR_FRI_FIELD(MeasurementDatagram, timestamp, 140, 4);
LWR_FRI_FIELD(MeasurementDatagram, state, 144, 2);
LWR_FRI_FIELD(MeasurementDatagram, quality, 146, 2);
LWR_FRI_FIELD(MeasurementDatagram, measurement_period, 148, 4);
LWR_FRI_FIELD(MeasurementDatagram, command_period, 152, 4);
LWR_FRI_FIELD(MeasurementDatagram, safety_scale, 156, 4);
LWR_FRI_FIELD(MeasurementDatagram, answer_rate, 160, 4);
LWR_FRI_FIELD(MeasurementDatagram, latency, 164, 4);
LWR_FRI_FIELD(MeasurementDatagram, jitter, 168, 4);
LWR_FRI_FIELD(MeasurementDatagram, miss_rate, 172, 4);
LWR_FRI_FIELD(MeasurementDatagram, miss_counter, 176, 4);
LWR_FRI_FIELD(MeasurementDatagram, power, 180, 2);
LWR_FRI_FIELD(MeasurementDatagram, control, 182, 2);
LWR_FRI_FIELD(MeasurementDatagram, drive_error, 184, 2);
LWR_FRI_FIELD(MeasurementDatagram, drive_warning, 186, 2);
LWR_FRI_FIELD(MeasurementDatagram, temperature, 188, 28);
LWR_FRI_FIELD(MeasurementDatagram, measured_position, 216, 28);
LWR_FRI_FIELD(MeasurementDatagram, measured_frame, 244, 48);
LWR_FRI_FIELD(MeasurementDatagram, commanded_position, 292, 28);
LWR_FRI_FIELD(MeasurementDatagram, commanded_position_offset, 320, 28);
LWR_FRI_FIELD(MeasurementDatagram, commanded_frame, 348, 48);
LWR_FRI_FIELD(MeasurementDatagram, commanded_frame_offset, 396, 48);
LWR_FRI_FIELD(MeasurementDatagram, measured_torque, 444, 28);
LWR_FRI_FIELD(MeasurementDatagram, external_torque, 472, 28);
LWR_FRI_FIELD(MeasurementDatagram, external_wrench, 500, 24);
LWR_FRI_FIELD(MeasurementDatagram, jacobian, 524, 168);
LWR_FRI_FIELD(MeasurementDatagram, mass_matrix, 692, 196);
LWR_FRI_FIELD(MeasurementDatagram, gravity, 888, 28);
static_assert(sizeof(MeasurementDatagram) == kMeasurementSize,
              "measurement datagram has a wrong size");

LWR_FRI_FIELD(CommandDatagram, header, 0, 8);
LWR_FRI_FIELD(CommandDatagram, krl, 8, 132);
LWR_FRI_FIELD(CommandDatagram, flags, 140, 4);
LWR_FRI_FIELD(CommandDatagram, joint_position, 144, 28);
LWR_FRI_FIELD(CommandDatagram, cartesian_frame, 172, 48);
LWR_FRI_FIELD(CommandDatagram, joint_torque, 220, 28);
LWR_FRI_FIELD(CommandDatagram, cartesian_force, 248, 24);
LWR_FRI_FIELD(CommandDatagram, joint_stiffness, 272, 28);
LWR_FRI_FIELD(CommandDatagram, joint_damping, 300, 28);
LWR_FRI_FIELD(CommandDatagram, cartesian_stiffness, 328, 24);
LWR_FRI_FIELD(CommandDatagram, cartesian_damping, 352, 24);
static_assert(sizeof(CommandDatagram) == kCommandSize, "command datagram has a wrong size");
#undef LWR_FRI_FIELD

static_assert(std::is_trivially_copyable_v<MeasurementDatagram> &&
              std::is_trivially_copyable_v<CommandDatagram>);

/// Copies a datagram from `size` received bytes. If the size differs from that of the type, returns
/// false and leaves `datagram` unchanged. The header is not checked.
template <typename Datagram>
bool decode(const std::uint8_t* bytes, std::size_t size, Datagram& datagram) {
  if (size != sizeof(Datagram)) return false;
  std::memcpy(&datagram, bytes, sizeof(Datagram));
  return true;
}

/// Writes the sizeof(datagram) bytes of the wire format.
template <typename Datagram>
void encode(const Datagram& datagram, std::uint8_t* bytes) {
  static_assert(std::is_same_v<Datagram, MeasurementDatagram> ||
                std::is_same_v<Datagram, CommandDatagram>);
  std::memcpy(bytes, &datagram, sizeof(Datagram));
}

/// Header of a measurement or a command with the given counters.
constexpr Header measurementHeader(std::uint16_t counter, std::uint16_t reflected) {
  return {counter, reflected, static_cast<std::uint16_t>(kMeasurementSize), kMeasurementId};
}
constexpr Header commandHeader(std::uint16_t counter, std::uint16_t reflected) {
  return {counter, reflected, static_cast<std::uint16_t>(kCommandSize), kCommandId};
}

/// Converts a joint array of the wire to a vector in the same order.
inline Vector7 jointsFromWire(const float (&wire)[kJoints]) {
  Vector7 joints;
  for (std::size_t i = 0; i < kJoints; ++i) joints[static_cast<Eigen::Index>(i)] = wire[i];
  return joints;
}

/// Converts a vector to a joint array of the wire, rounded to float32.
inline void jointsToWire(const Vector7& joints, float (&wire)[kJoints]) {
  for (std::size_t i = 0; i < kJoints; ++i)
    wire[i] = static_cast<float>(joints[static_cast<Eigen::Index>(i)]);
}

/// Converts Fx Fy Fz Tz Ty Tx of the wire to Fx Fy Fz Tx Ty Tz.
inline Vector6 wrenchFromWire(const float (&wire)[kCartesian]) {
  Vector6 wrench;
  wrench << wire[0], wire[1], wire[2], wire[5], wire[4], wire[3];
  return wrench;
}

/// Converts Fx Fy Fz Tx Ty Tz to Fx Fy Fz Tz Ty Tx of the wire; also for stiffness and damping.
inline void wrenchToWire(const Vector6& wrench, float (&wire)[kCartesian]) {
  for (int i = 0; i < 3; ++i) {
    wire[i] = static_cast<float>(wrench[i]);
    wire[3 + i] = static_cast<float>(wrench[5 - i]);
  }
}

/// Current set-point of the controller, rad: its own command plus the offset of FRI. The sum is in
/// float32, as in the controller's own comparison.
inline void setPointOf(const MeasurementDatagram& measurement, float (&set_point)[kJoints]) {
  for (std::size_t i = 0; i < kJoints; ++i) {
    set_point[i] = measurement.commanded_position[i] + measurement.commanded_position_offset[i];
  }
}

/// Cartesian set-point, m: KRC's own command times the frame of FRI (commanded_frame *
/// commanded_frame_offset). An offset with an all-zero rotation (from controllers that do not fill
/// it) is ignored.
void cartesianSetPointOf(const MeasurementDatagram& measurement, float (&frame)[kFrameValues]);

/// Names as on the controller's displays; "?" for numbers outside the enumeration.
const char* nameOf(FriState state);
const char* nameOf(Quality quality);
const char* nameOf(ControlStrategy strategy);

}  // namespace lwr_fri_bridge::fri
