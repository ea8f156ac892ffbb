#include "ctrl_more/cycle/controller_status.hpp"

namespace ctrl_more {

const char* nameOf(Activity activity) {
  switch (activity) {
    case Activity::Off:
      return "off";
    case Activity::Running:
      return "running";
    case Activity::Stopping:
      return "stopping";
    case Activity::Waiting:
      return "waiting";
  }
  return "";
}

const char* nameOf(FaultKind kind) {
  switch (kind) {
    case FaultKind::None:
      return "none";
    case FaultKind::Exception:
      return "exception";
    case FaultKind::Declared:
      return "reported by the controller";
    case FaultKind::NotFinite:
      return "number that is not finite";
    case FaultKind::NotUnit:
      return "quaternion that is not unit";
    case FaultKind::CorrectionSize:
      return "correction larger than declared";
    case FaultKind::CorrectionRate:
      return "correction faster than declared";
    case FaultKind::Undeclared:
      return "write to a signal that is not declared";
    case FaultKind::Overrun:
      return "overrun";
  }
  return "";
}

}  // namespace ctrl_more
