/// The codes have the numbers of coglab_msgs/ReasonCode, read here as the file has them.
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <regex>
#include <string>

#include "coglab_rt/reason.hpp"

namespace coglab_rt {
namespace {

using Code = ReasonCode;

const std::map<std::string, ReasonCode> kCodes = {
    {"NONE", Code::None},
    {"INVALID_ARGUMENT", Code::InvalidArgument},
    {"OUT_OF_RANGE", Code::OutOfRange},
    {"UNKNOWN_NAME", Code::UnknownName},
    {"BUSY", Code::Busy},
    {"QUEUE_FULL", Code::QueueFull},
    {"NOT_ACTIVE", Code::NotActive},
    {"NOT_ADOPTED", Code::NotAdopted},
    {"TOO_LATE", Code::TooLate},
    {"NOTHING_RUNS", Code::NothingRuns},
    {"BAD_FILE", Code::BadFile},
    {"NOT_SUPPORTED", Code::NotSupported},
    {"ROBOT_DISCONNECTED", Code::RobotDisconnected},
    {"NOT_IN_COMMAND_MODE", Code::NotInCommandMode},
    {"NO_POWER", Code::NoPower},
    {"NOT_STARTED", Code::NotStarted},
    {"HELD", Code::Held},
    {"STOPPING", Code::Stopping},
    {"LEASHED", Code::Leashed},
    {"POOR_QUALITY", Code::PoorQuality},
    {"DRIVE_ERROR", Code::DriveError},
    {"STALE_JOINT_STATE", Code::StaleJointState},
    {"COMPUTER_LATE", Code::ComputerLate},
    {"SECOND_SENDER", Code::SecondSender},
    {"DRIVE_WARNING", Code::DriveWarning},
    {"COMMANDS_REFUSED", Code::CommandsRefused},
    {"NO_REAL_TIME", Code::NoRealTime},
    {"GOAL_MISSING", Code::GoalMissing},
    {"GOAL_STALE", Code::GoalStale},
    {"GOAL_FROM_FUTURE", Code::GoalFromFuture},
    {"GOAL_JUMPED", Code::GoalJumped},
    {"GOAL_LOST", Code::GoalLost},
    {"GOAL_OUTSIDE_WORKSPACE", Code::GoalOutsideWorkspace},
    {"GOAL_UNREACHABLE", Code::GoalUnreachable},
    {"GOAL_LEFT_REGION", Code::GoalLeftRegion},
    {"GOAL_WITHDRAWN", Code::GoalWithdrawn},
    {"GOAL_FELL", Code::GoalFell},
    {"CANCELLED", Code::Cancelled},
    {"SWITCHED", Code::Switched},
    {"SUPERSEDED", Code::Superseded},
    {"JOINT_BLOCKED", Code::JointBlocked},
    {"WORKSPACE_BORDER", Code::WorkspaceBorder},
    {"TARGET_NOT_REACHED", Code::TargetNotReached},
    {"CONTROLLER_FAULT", Code::ControllerFault},
    {"CYCLE_STALLED", Code::CycleStalled},
    {"TIME_LIMIT", Code::TimeLimit},
};

TEST(ReasonCodes, AreTheNumbersOfTheMessage) {
  std::ifstream message(REASON_CODES);
  std::map<std::string, int> numbers;
  const std::regex constant(R"(^uint16 (\w+)=(\d+))");
  for (std::string line; std::getline(message, line);) {
    std::smatch found;
    if (std::regex_search(line, found, constant)) numbers[found[1]] = std::stoi(found[2]);
  }
  for (const auto& [name, code] : kCodes) {
    ASSERT_EQ(numbers.count(name), 1U) << name;
    EXPECT_EQ(Reason(code).number(), numbers[name]) << name;
  }
}

}  // namespace
}  // namespace coglab_rt
