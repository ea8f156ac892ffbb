/// @file
/// Records that the control cycle and a Python process exchange (coglab/control/slot.py has the
/// same fields). All numbers have 8 bytes. Poses are x y z and the quaternion x y z w of the tool
/// in the robot's base frame.
#pragma once

#include <cstdint>

#include "coglab_controllers/remote/shared_record.hpp"

namespace coglab_controllers {

/// Version of the records. Raise it when a field or its meaning changes. Other versions are
/// refused.
constexpr int kRemoteInterface = 1;

/// Kind of controller behind a slot.
enum class RemoteKind : std::int64_t { Motion = 1, Feedback = 2 };

/// From the cycle, in each cycle while a motion or the feedback controller runs.
struct RemoteQuestion {
  std::int64_t stamp_ns;    ///< of the sample, on the clock of the samples
  std::int64_t written_ns;  ///< on the steady clock
  std::int64_t run;         ///< number of the motion, or of the reset; 0: none yet
  std::int64_t running;     ///< 0: the motion has ended
  std::int64_t late;        ///< cycles of this run without an answer to one of the last two
  std::int64_t refused;     ///< number of unusable answers in this run
  std::int64_t cycle;       ///< number of the cycle in this run
  double dt;                ///< s, true time since the last cycle
  double time, next;        ///< s of motion time
  double joints[7], joint_velocity[7], joint_torque[7], external_torque[7];  ///< rad, rad/s, Nm
  double wrench[6];                                                          ///< N, Nm
  double hand[7];                                 ///< pose by the measured joints
  double from_joints[7], from_joint_velocity[7];  ///< set-point at the start of the run
  double from_pose[7], from_twist[6];             ///< the same in space; m/s, rad/s
  double reference_pose[7], reference_twist[6];   ///< original references (feedback)
};

/// What an answer contains.
enum class RemoteAnswerKind : std::int64_t {
  Rest = 0,        ///< the arm brakes and stands
  Joints = 1,      ///< values: joints (7) rad, joint velocity (7) rad/s of motion time
  Pose = 2,        ///< values: pose (7), twist (6) per second of motion time
  Correction = 3,  ///< values: offset (3) m, rotation vector (3) rad, base frame
  GiveUp = 4       ///< the controller raised an exception; the process reports which
};

/// From the Python process.
struct RemoteAnswer {
  std::int64_t stamp_ns;  ///< that of the question
  std::int64_t run;       ///< that of the question
  std::int64_t kind;      ///< RemoteAnswerKind
  std::int64_t done;      ///< 1: the reference has ended
  double time;            ///< s of motion time for which the values hold
  double values[14];
};

/// The whole shared memory.
struct RemoteSegment {
  alignas(64) SharedRecord<RemoteQuestion> question;
  alignas(64) SharedRecord<RemoteAnswer> answer;
};

/// Sizes in bytes for the greeting; a process with others is refused.
constexpr std::size_t kQuestionSize = sizeof(RemoteQuestion), kAnswerSize = sizeof(RemoteAnswer);

}  // namespace coglab_controllers
