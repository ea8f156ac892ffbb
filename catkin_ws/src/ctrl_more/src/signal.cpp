#include "ctrl_more/signal.hpp"

#include "ctrl_more/controller_status.hpp"
#include "ctrl_more/cycle.hpp"
#include "ctrl_more/description.hpp"

namespace ctrl_more {

const char* nameOf(RobotSource source) {
  return source == RobotSource::Measured ? "measuredData" : "estimatedData";
}

const char* nameOf(ControlContainer container) {
  switch (container) {
    case ControlContainer::TaskSpaceReferencePose: return "taskSpaceReferencePose";
    case ControlContainer::TaskSpaceReferenceVel: return "taskSpaceReferenceVel";
    case ControlContainer::TaskSpaceReferenceAcc: return "taskSpaceReferenceAcc";
    case ControlContainer::JointSpaceReference: return "jointSpaceReference";
    case ControlContainer::OtherReference: return "otherReference";
    case ControlContainer::CentreOfMass: return "centreOfMass";
    case ControlContainer::LinearMomentum: return "linearMomentum";
    case ControlContainer::AngularMomentum: return "angularMomentum";
    case ControlContainer::Zmp: return "zmp";
    case ControlContainer::PelvisOrientation: return "pelvisOrientation";
  }
  return "";
}

SignalKind kindOf(ControlContainer container) {
  switch (container) {
    case ControlContainer::TaskSpaceReferencePose: return SignalKind::Pose;
    case ControlContainer::PelvisOrientation: return SignalKind::Quaternion;
    default: return SignalKind::Vector;
  }
}

int fixedSizeOf(ControlContainer container) {
  switch (container) {
    case ControlContainer::TaskSpaceReferencePose: return 7;
    case ControlContainer::TaskSpaceReferenceVel:
    case ControlContainer::TaskSpaceReferenceAcc: return 6;
    case ControlContainer::JointSpaceReference:
    case ControlContainer::OtherReference: return 0;
    case ControlContainer::PelvisOrientation: return 4;
    default: return 3;
  }
}

const char* nameOf(Stage stage) { return stage == Stage::Task ? "task" : "joint"; }

const char* nameOf(StopPolicy policy) {
  switch (policy) {
    case StopPolicy::ByKind: return "by kind";
    case StopPolicy::Hold: return "hold";
    case StopPolicy::Fade: return "fade";
    case StopPolicy::Zero: return "zero";
  }
  return "";
}

const char* nameOf(Activity activity) {
  switch (activity) {
    case Activity::Off: return "off";
    case Activity::Running: return "running";
    case Activity::Stopping: return "stopping";
    case Activity::Waiting: return "waiting";
  }
  return "";
}

const char* nameOf(FaultKind kind) {
  switch (kind) {
    case FaultKind::None: return "none";
    case FaultKind::Exception: return "exception";
    case FaultKind::Declared: return "reported by the controller";
    case FaultKind::NotFinite: return "number that is not finite";
    case FaultKind::NotUnit: return "quaternion that is not unit";
    case FaultKind::CorrectionSize: return "correction larger than declared";
    case FaultKind::CorrectionRate: return "correction faster than declared";
    case FaultKind::Undeclared: return "write to a signal that is not declared";
    case FaultKind::Overrun: return "overrun";
  }
  return "";
}

}  // namespace ctrl_more
