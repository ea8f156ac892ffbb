#include "coglab_controllers/manager/reason.hpp"

namespace coglab_controllers {

ReasonCode codeOf(lwr_fri_bridge::MotionBlock block) noexcept {
  using lwr_fri_bridge::MotionBlock;
  switch (block) {
    case MotionBlock::None:
      return ReasonCode::None;
    case MotionBlock::Disconnected:
      return ReasonCode::RobotDisconnected;
    case MotionBlock::Monitor:
      return ReasonCode::NotInCommandMode;
    case MotionBlock::NoPower:
      return ReasonCode::NoPower;
    case MotionBlock::NotStarted:
      return ReasonCode::NotStarted;
    case MotionBlock::Held:
      return ReasonCode::Held;
    case MotionBlock::Stopping:
      return ReasonCode::Stopping;
    case MotionBlock::Leashed:
      return ReasonCode::Leashed;
    case MotionBlock::PoorQuality:
      return ReasonCode::PoorQuality;
    case MotionBlock::DriveError:
      return ReasonCode::DriveError;
  }
  return ReasonCode::NotStarted;
}

}  // namespace coglab_controllers
