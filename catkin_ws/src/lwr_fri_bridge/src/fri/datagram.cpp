#include "lwr_fri_bridge/fri/datagram.hpp"

namespace lwr_fri_bridge::fri {

const char* nameOf(FriState state) {
  switch (state) {
    case FriState::Off:
      return "OFF";
    case FriState::Monitor:
      return "MON";
    case FriState::Command:
      return "CMD";
  }
  return "?";
}

const char* nameOf(Quality quality) {
  switch (quality) {
    case Quality::Unacceptable:
      return "UNACCEPTABLE";
    case Quality::Bad:
      return "BAD";
    case Quality::Ok:
      return "OK";
    case Quality::Perfect:
      return "PERFECT";
  }
  return "?";
}

const char* nameOf(ControlStrategy strategy) {
  switch (strategy) {
    case ControlStrategy::Other:
      return "OTHER";
    case ControlStrategy::Position:
      return "POSITION";
    case ControlStrategy::CartesianImpedance:
      return "CART_IMP";
    case ControlStrategy::JointImpedance:
      return "JNT_IMP";
  }
  return "?";
}

}  // namespace lwr_fri_bridge::fri
