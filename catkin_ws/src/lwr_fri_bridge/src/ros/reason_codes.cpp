#include "lwr_fri_bridge/ros/reason_codes.hpp"

#include <coglab_msgs/ReasonCode.h>

#include "coglab_rt/reason.hpp"
#include "lwr_fri_bridge/bridge/diagnosis.hpp"

namespace lwr_fri_bridge {
namespace {

using Code = coglab_msgs::ReasonCode;

struct Row {
  OutcomeCode value;
  std::uint16_t code;
};

constexpr Row kOutcomes[] = {
    {OutcomeCode::Pending, Code::NONE},
    {OutcomeCode::Done, Code::NONE},
    {OutcomeCode::AlreadyThere, Code::NONE},
    {OutcomeCode::Disconnected, Code::ROBOT_DISCONNECTED},
    {OutcomeCode::Held, Code::HELD},
    {OutcomeCode::InCommandMode, Code::BUSY},
    {OutcomeCode::NotSupported, Code::NOT_SUPPORTED},
    {OutcomeCode::PoorQuality, Code::POOR_QUALITY},
    {OutcomeCode::NoKrlProgram, Code::NOT_SUPPORTED},
    {OutcomeCode::ProgramRefused, Code::NOT_IN_COMMAND_MODE},
    {OutcomeCode::NotEntered, Code::NOT_IN_COMMAND_MODE},
    {OutcomeCode::NoPower, Code::NO_POWER},
    {OutcomeCode::WrongStrategy, Code::NOT_SUPPORTED},
    {OutcomeCode::NotLeft, Code::TIME_LIMIT},
    {OutcomeCode::Interrupted, Code::CANCELLED},
    {OutcomeCode::Busy, Code::BUSY},
    {OutcomeCode::LostConnection, Code::ROBOT_DISCONNECTED},
    {OutcomeCode::NotServed, Code::NOT_ADOPTED},
};

}  // namespace

std::uint16_t reasonCode(MotionBlock block) { return static_cast<std::uint16_t>(codeOf(block)); }

std::uint16_t reasonCode(MotionBlock block, const CommandModeLoss& loss) {
  return static_cast<std::uint16_t>(codeOf(block, loss));
}

std::uint16_t reasonCode(OutcomeCode code) {
  for (const Row& row : kOutcomes) {
    if (row.value == code) return row.code;
  }
  return Code::UNEXPECTED;
}

}  // namespace lwr_fri_bridge
