#include "lwr_fri_bridge/bridge/diagnosis.hpp"

#include <cstdio>

namespace lwr_fri_bridge {

namespace {

std::string number(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::string jointsIn(unsigned bits) {
  std::string names;
  for (int i = 0; i < 7; ++i) {
    if ((bits >> i) & 1U) names += std::string(names.empty() ? "" : ", ") + kJointNames[i];
  }
  return names;
}

}  // namespace

Diagnosis diagnoseConnection(const Snapshot& s, const FriThreadStatistics& thread, int port,
                             double silence) {
  if (s.supervisor == SupervisorState::Disconnected) {
    std::string text = "no valid packet received on port " + std::to_string(port) + " for " +
                       number("%.0f s", silence);
    text += s.session.rejected() > 0 ? "; what comes is rejected (see the counters): is it an FRI "
                                       "controller of this version?"
                                     : "; check cable, FRIHOST and FRISOCK (or friSetup) of the "
                                       "controller, and that its KRL program called friOpen";
    return {Severity::Error, text, ReasonCode::RobotDisconnected};
  }
  const double cycle = s.sample.cycle_time;
  if (s.quality <= fri::Quality::Bad) {
    std::string text = std::string("quality ") + fri::nameOf(s.quality) + ": ";
    if (s.miss_rate > 0.05F && s.latency > 0.5 * cycle) {
      text += number("answers take %.2f ms", 1e3 * s.latency) +
              number(" of a %.0f ms cycle", 1e3 * cycle) +
              (thread.real_time
                   ? "; use a direct cable, a real computer instead of a virtual machine, or a "
                     "longer friOpen period"
                   : "; the FRI thread has no real-time priority, give the binary cap_sys_nice");
    } else if (s.session.lost_measurements + s.session.lost_answers > 0) {
      text +=
          "packets are lost on the way; use a direct cable and a network card of its own, no "
          "switch and no Wi-Fi";
    } else {
      text +=
          "it needs 100 answered packets to judge; if it stays, look at the load of this computer";
    }
    return {s.quality == fri::Quality::Unacceptable ? Severity::Error : Severity::Warning, text,
            ReasonCode::PoorQuality};
  }
  if (!thread.last_foreign.empty()) {
    return {Severity::Warning,
            "a second sender (" + thread.last_foreign +
                ") uses the port and is ignored; the peer is " + thread.peer +
                ": if that is not the robot controller, set controller_address",
            ReasonCode::SecondSender};
  }
  return {Severity::Ok, std::string("quality ") + fri::nameOf(s.quality) + " from " + thread.peer +
                            number(", latency %.2f ms", 1e3 * s.latency) +
                            number(", cycle %.0f ms", 1e3 * cycle)};
}

Diagnosis diagnoseArm(const Snapshot& s, double hot) {
  if (s.supervisor == SupervisorState::Disconnected)
    return {Severity::Warning, "not connected", ReasonCode::RobotDisconnected};
  // There are only seven drives. Higher bits have no meaning.
  if (const unsigned drives = s.drive_error & fri::kAllDrivesOn; drives != 0)
    return {Severity::Error, "drive error: " + jointsIn(drives), ReasonCode::DriveError};
  unsigned hot_joints = 0;
  for (unsigned i = 0; i < 7; ++i) hot_joints |= s.temperature[i] > hot ? 1U << i : 0U;
  if (hot_joints != 0)
    return {Severity::Warning, "drives are hot: " + jointsIn(hot_joints), ReasonCode::DriveWarning};
  if (const unsigned drives = s.drive_warning & fri::kAllDrivesOn; drives != 0)
    return {Severity::Warning, "drive warning: " + jointsIn(drives), ReasonCode::DriveWarning};
  const std::string reason = reasonOf(s.sample.block, s.sample.blocking_joint, s.loss);
  return {Severity::Ok, reason.empty() ? "motion is allowed" : reason + advice(s.sample.block),
          codeOf(s.sample.block, s.loss)};
}

ReasonCode codeOf(MotionBlock block, const CommandModeLoss& loss) {
  const bool lost = block == MotionBlock::Monitor || block == MotionBlock::NotStarted;
  return lost && loss.byComputer() ? ReasonCode::ComputerLate : codeOf(block);
}

std::string reasonOf(MotionBlock block, int joint, const CommandModeLoss& loss) {
  std::string reason = describe(block);
  if (block == MotionBlock::Leashed && joint >= 0)
    reason = std::string(kJointNames[joint]) + ": " + reason;
  const bool lost = block == MotionBlock::Disconnected || block == MotionBlock::Monitor ||
                    block == MotionBlock::NoPower || block == MotionBlock::NotStarted;
  if (lost && loss.cause != LossCause::None) reason = describe(loss) + "; now: " + reason;
  return reason;
}

}  // namespace lwr_fri_bridge
