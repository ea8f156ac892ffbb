/// @file
/// Reason for a refusal, a hold or an end: a code for programs and a sentence for people.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "coglab_rt/fixed_text.hpp"
#include "coglab_rt/robot_sample.hpp"

namespace coglab_rt {

/// The codes of coglab_msgs/ReasonCode that arms, motions and their requests use. The ROS side
/// checks that they are equal. Their meaning is documented there.
enum class ReasonCode : std::uint16_t {
  None = 0,

  InvalidArgument = 100,
  OutOfRange = 101,
  UnknownName = 102,
  Busy = 103,
  QueueFull = 104,
  NotActive = 105,
  NotAdopted = 106,
  TooLate = 107,
  NothingRuns = 108,
  BadFile = 109,
  NotSupported = 110,

  RobotDisconnected = 200,
  NotInCommandMode = 201,
  NoPower = 202,
  NotStarted = 203,
  Held = 204,
  Stopping = 205,
  Leashed = 206,
  PoorQuality = 207,
  DriveError = 208,
  StaleJointState = 209,
  ComputerLate = 210,
  SecondSender = 220,
  DriveWarning = 221,
  CommandsRefused = 222,
  NoRealTime = 223,

  GoalMissing = 300,
  GoalStale = 301,
  GoalFromFuture = 302,
  GoalJumped = 303,
  GoalLost = 304,
  GoalOutsideWorkspace = 305,
  GoalUnreachable = 306,
  GoalLeftRegion = 307,
  GoalWithdrawn = 308,
  GoalFell = 309,

  Cancelled = 400,
  Switched = 401,
  Superseded = 402,
  JointBlocked = 403,
  WorkspaceBorder = 404,
  TargetNotReached = 405,
  ControllerFault = 406,
  CycleStalled = 407,
  TimeLimit = 408,

  WaitsForPerson = 644
};

/// A code with its sentence. It can be composed inside the control cycle: no allocation.
class Reason {
 public:
  /// No fault.
  Reason() = default;
  /// @param code any code but None  @param text beginning of the sentence; << appends the rest
  explicit Reason(ReasonCode code, const char* text = "") : code_(code), text_(text) {}

  template <typename Part>
  Reason& operator<<(Part part) {
    text_ << part;
    return *this;
  }

  ReasonCode code() const { return code_; }
  /// The code as a number, as in messages.
  std::uint16_t number() const { return static_cast<std::uint16_t>(code_); }
  bool empty() const { return code_ == ReasonCode::None; }
  void clear() { *this = Reason(); }
  const char* c_str() const { return text_.c_str(); }
  std::string str() const { return text_.str(); }

 private:
  ReasonCode code_ = ReasonCode::None;
  FixedText<200> text_;
};

/// Result of a request: code and sentence for the user if it was refused, otherwise optionally a
/// note.
struct Answer {
  bool success = true;
  std::string message;
  ReasonCode code = ReasonCode::None;

  static Answer refusal(ReasonCode code, std::string why) { return {false, std::move(why), code}; }
  static Answer invalid(std::string why) {
    return refusal(ReasonCode::InvalidArgument, std::move(why));
  }
  static Answer refusal(const Reason& why) { return {false, why.str(), why.code()}; }
  /// The code as a number, as in messages.
  std::uint16_t number() const { return static_cast<std::uint16_t>(code); }
};

/// A reason why an arm may not move, and its code.
struct BlockCode {
  MotionBlock block;
  ReasonCode code;
};
constexpr BlockCode kBlockCodes[] = {
    {MotionBlock::None, ReasonCode::None},
    {MotionBlock::Disconnected, ReasonCode::RobotDisconnected},
    {MotionBlock::Monitor, ReasonCode::NotInCommandMode},
    {MotionBlock::NoPower, ReasonCode::NoPower},
    {MotionBlock::NotStarted, ReasonCode::NotStarted},
    {MotionBlock::Held, ReasonCode::Held},
    {MotionBlock::Stopping, ReasonCode::Stopping},
    {MotionBlock::Leashed, ReasonCode::Leashed},
    {MotionBlock::PoorQuality, ReasonCode::PoorQuality},
    {MotionBlock::DriveError, ReasonCode::DriveError},
};

/// Code of the reason why the arm may not move; None for MotionBlock::None. Real-time safe.
inline ReasonCode codeOf(MotionBlock block) noexcept {
  for (const BlockCode& row : kBlockCodes) {
    if (row.block == block) return row.code;
  }
  return ReasonCode::NotStarted;
}

/// Inverse of codeOf, from the number in a message; NotStarted for any other number.
inline MotionBlock motionBlockOf(std::uint16_t number) noexcept {
  for (const BlockCode& row : kBlockCodes) {
    if (static_cast<std::uint16_t>(row.code) == number) return row.block;
  }
  return MotionBlock::NotStarted;
}

}  // namespace coglab_rt
