#include "lwr_fri_bridge/fri/datagram.hpp"

#include <cmath>

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

void cartesianSetPointOf(const MeasurementDatagram& m, float (&frame)[kFrameValues]) {
  const float* c = m.commanded_frame;
  const float* o = m.commanded_frame_offset;
  float rotation = 0.0F;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rotation += std::fabs(o[4 * row + column]);
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      float value = c[4 * row + column];
      if (rotation > 0.0F) {
        value = column == 3 ? c[4 * row + 3] : 0.0F;
        for (int k = 0; k < 3; ++k) value += c[4 * row + k] * o[4 * k + column];
      }
      frame[4 * row + column] = value;
    }
  }
}

}  // namespace lwr_fri_bridge::fri
