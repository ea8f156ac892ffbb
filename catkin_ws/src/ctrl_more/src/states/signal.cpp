#include "ctrl_more/states/signal.hpp"

#include "ctrl_more/states/cycle.hpp"

namespace ctrl_more {

const SignalGroup& groupOf(RobotSource source) {
  static const SignalGroup groups[kRobotSources] = {{"measuredData"}, {"estimatedData"}};
  return groups[static_cast<int>(source)];
}

// In the order of ControlContainer.
const SignalGroup& groupOf(ControlContainer container) {
  static const SignalGroup groups[kControlContainers] = {
      {"taskSpaceReferencePose", SignalKind::Pose, 7},
      {"taskSpaceReferenceVel", SignalKind::Vector, 6},
      {"taskSpaceReferenceAcc", SignalKind::Vector, 6},
      {"jointSpaceReference"},
      {"otherReference"},
      {"centreOfMass", SignalKind::Vector, 3},
      {"linearMomentum", SignalKind::Vector, 3},
      {"angularMomentum", SignalKind::Vector, 3},
      {"zmp", SignalKind::Vector, 3},
      {"pelvisOrientation", SignalKind::Quaternion, 4},
  };
  return groups[static_cast<int>(container)];
}

const char* nameOf(Stage stage) { return stage == Stage::Task ? "task" : "joint"; }

}  // namespace ctrl_more
