#include "lwr_fri_bridge/reason_codes.hpp"

#include <coglab_msgs/ReasonCode.h>

namespace lwr_fri_bridge {
namespace {

using Code = coglab_msgs::ReasonCode;

template <typename Value>
struct Row {
  Value value;
  std::uint16_t code;
};

constexpr Row<MotionBlock> kBlocks[] = {
    {MotionBlock::None, Code::NONE},
    {MotionBlock::Disconnected, Code::ROBOT_DISCONNECTED},
    {MotionBlock::Monitor, Code::NOT_IN_COMMAND_MODE},
    {MotionBlock::NoPower, Code::NO_POWER},
    {MotionBlock::NotStarted, Code::NOT_STARTED},
    {MotionBlock::Held, Code::HELD},
    {MotionBlock::Stopping, Code::STOPPING},
    {MotionBlock::Leashed, Code::LEASHED},
    {MotionBlock::PoorQuality, Code::POOR_QUALITY},
    {MotionBlock::DriveError, Code::DRIVE_ERROR},
};

constexpr Row<OutcomeCode> kOutcomes[] = {
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

template <typename Value, std::size_t N>
std::uint16_t codeOf(const Row<Value> (&table)[N], Value value) {
  for (const Row<Value>& row : table) {
    if (row.value == value) return row.code;
  }
  return Code::UNEXPECTED;
}

}  // namespace

std::uint16_t reasonCode(MotionBlock block) { return codeOf(kBlocks, block); }

std::uint16_t reasonCode(MotionBlock block, const CommandModeLoss& loss) {
  const bool lost = block == MotionBlock::Monitor || block == MotionBlock::NotStarted;
  if (lost && loss.byComputer()) return Code::COMPUTER_LATE;
  return reasonCode(block);
}

std::uint16_t reasonCode(OutcomeCode code) { return codeOf(kOutcomes, code); }

MotionBlock motionBlockOf(std::uint16_t reason_code) {
  for (const Row<MotionBlock>& row : kBlocks) {
    if (row.code == reason_code) return row.value;
  }
  return MotionBlock::NotStarted;
}

}  // namespace lwr_fri_bridge
