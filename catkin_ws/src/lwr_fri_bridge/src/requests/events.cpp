#include "lwr_fri_bridge/requests/events.hpp"

#include <charconv>
#include <cmath>
#include <cstdio>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace lwr_fri_bridge {
namespace {

// CogLab's own ranges. No public source gives the controller's ranges; it checks them itself.
constexpr double kSoftest = 0.01, kStiffestJoint = 2000.0, kStiffestTranslation = 5000.0,
                 kStiffestRotation = 300.0;
constexpr double kLeastDamping = 0.1, kMostDamping = 1.0;

[[noreturn]] void fail(const std::string& what) {
  throw std::invalid_argument(what + "; known events: " + knownEvents());
}

void checkRange(const std::string& name, double value, double low, double high) {
  if (!(value >= low && value <= high)) {
    std::ostringstream text;
    text << name << " " << value << " is outside " << low << ".." << high;
    fail(text.str());
  }
}

Vector7 jointValues(const std::string& name, const std::vector<double>& values, double low,
                    double high) {
  if (values.size() != 1 && values.size() != 7) {
    fail(name + ": expected 1 or 7 values, got " + std::to_string(values.size()));
  }
  Vector7 result;
  for (std::size_t i = 0; i < 7; ++i) {
    const double value = values[values.size() == 1 ? 0 : i];
    checkRange(name, value, low, high);
    result[static_cast<Eigen::Index>(i)] = value;
  }
  return result;
}

Vector6 cartesianValues(const std::string& name, const std::vector<double>& values, double low,
                        double high_translation, double high_rotation, bool one_allowed) {
  const std::size_t n = values.size();
  if (n != 2 && n != 6 && !(n == 1 && one_allowed)) {
    fail(name + ": expected " + (one_allowed ? "1, " : "") +
         "2 (translation, rotation) or 6 values, got " + std::to_string(n));
  }
  Vector6 result;
  for (std::size_t i = 0; i < 6; ++i) {
    const double value = n == 6 ? values[i] : n == 2 ? values[i / 3] : values[0];
    checkRange(name, value, low, i < 3 ? high_translation : high_rotation);
    result[static_cast<Eigen::Index>(i)] = value;
  }
  return result;
}

void readParameters(const std::vector<std::string>& words, ControlMode& mode) {
  std::size_t next = 1;
  while (next < words.size()) {
    const std::string name = words[next++];
    if (name != "stiffness" && name != "damping")
      fail("'" + name + "': expected 'stiffness' or 'damping'");
    std::vector<double> values;
    for (; next < words.size() && words[next] != "stiffness" && words[next] != "damping"; ++next) {
      const std::string& word = words[next];
      double value = NAN;
      const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
      if (error != std::errc() || end != word.data() + word.size())
        fail("'" + word + "' in " + name + " is not a number");
      values.push_back(value);
    }
    const bool stiffness = name == "stiffness";
    if (mode.strategy == fri::ControlStrategy::JointImpedance) {
      (stiffness ? mode.joint_stiffness : mode.joint_damping) =
          stiffness ? jointValues(name, values, kSoftest, kStiffestJoint)
                    : jointValues(name, values, kLeastDamping, kMostDamping);
    } else {
      (stiffness ? mode.cartesian_stiffness : mode.cartesian_damping) =
          stiffness
              ? cartesianValues(name, values, kSoftest, kStiffestTranslation, kStiffestRotation,
                                false)
              : cartesianValues(name, values, kLeastDamping, kMostDamping, kMostDamping, true);
    }
  }
}

const char* wordFor(EventKind kind) {
  switch (kind) {
    case EventKind::Start:
      return "start";
    case EventKind::Hold:
      return "hold";
    case EventKind::Reset:
      return "reset";
    case EventKind::Stop:
      return "stop";
    case EventKind::Mode:
      return "control mode";
  }
  return "?";
}

const char* wordsFor(fri::KrlResult result) {
  switch (result) {
    case fri::KrlResult::None:
      return "no reason given";
    case fri::KrlResult::Done:
      return "done";
    case fri::KrlResult::UnknownRequest:
      return "it does not know the request or the strategy";
    case fri::KrlResult::PoorQuality:
      return "the quality of the connection did not become good";
    case fri::KrlResult::NotEntered:
      return "friStart did not lead to command mode: read the messages on the pendant";
    case fri::KrlResult::NoDrives:
      return "drives or brakes could not be switched on: enabling switch, emergency stop?";
  }
  return "unknown reason";
}

}  // namespace

const char* knownEvents() {
  return "start, hold, reset, stop, position, joint_impedance [stiffness k] [damping d], "
         "cartesian_impedance [stiffness k] [damping d]";
}

Event parseEvent(const std::string& text, const ControlMode& current) {
  std::string spaced = text;
  for (char& c : spaced) {
    if (c == ',' || c == '=' || c == ':') c = ' ';
  }
  std::istringstream stream(spaced);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  if (words.empty()) fail("empty event");

  Event event;
  event.mode = current;
  const std::string& name = words[0];
  bool parameters = false;
  if (name == "start") {
    event.kind = EventKind::Start;
  } else if (name == "hold") {
    event.kind = EventKind::Hold;
  } else if (name == "reset") {
    event.kind = EventKind::Reset;
  } else if (name == "stop") {
    event.kind = EventKind::Stop;
  } else if (name == "position") {
    event.kind = EventKind::Mode;
    event.mode.strategy = fri::ControlStrategy::Position;
  } else if (name == "joint_impedance" || name == "cartesian_impedance") {
    event.kind = EventKind::Mode;
    event.mode.strategy = name == "joint_impedance" ? fri::ControlStrategy::JointImpedance
                                                    : fri::ControlStrategy::CartesianImpedance;
    parameters = true;
  } else {
    fail("unknown event '" + name + "'");
  }
  if (parameters) {
    readParameters(words, event.mode);
  } else if (words.size() > 1) {
    fail("'" + name + "' takes no parameters, got '" + words[1] + "'");
  }
  return event;
}

std::string describe(const Outcome& o) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f s", o.waited);
  const std::string seconds = text;
  const std::string word = wordFor(o.kind);
  switch (o.code) {
    case OutcomeCode::Pending:
      return word + ": not finished yet";
    case OutcomeCode::Done:
      if (o.kind == EventKind::Mode) return std::string("next start uses ") + fri::nameOf(o.wanted);
      if (o.kind == EventKind::Start) {
        return std::string("command mode with ") + fri::nameOf(o.reported) + " after " + seconds;
      }
      return word + ": done";
    case OutcomeCode::AlreadyThere:
      return word + ": nothing to do, it is so already";
    case OutcomeCode::Disconnected:
      return word +
             ": no datagrams from the robot controller; is its FRI program running and sending to "
             "this port?";
    case OutcomeCode::Held:
      return word + " refused: hold is latched; send reset first";
    case OutcomeCode::InCommandMode:
      return word + " refused: strategy and flags may change in monitor mode only; send stop first";
    case OutcomeCode::NotSupported:
      return std::string("start refused: the KRL program of krl_convention ") +
             fri::nameOf(o.convention) + " cannot run " + fri::nameOf(o.wanted);
    case OutcomeCode::Interrupted:
      return word + ": interrupted by hold, stop or a fall-back";
    case OutcomeCode::Busy:
      return word + " refused: a start or stop is in progress; wait for its outcome";
    case OutcomeCode::LostConnection:
      return word + ": the robot controller fell silent after " + seconds;
    case OutcomeCode::NotServed:
      return word + ": the FRI thread did not take the request within " + seconds;
    case OutcomeCode::PoorQuality:
      return std::string("start: quality of the connection is ") + fri::nameOf(o.quality) +
             " after " + seconds +
             ", OK or PERFECT is needed; see /diagnostics for latency and losses";
    case OutcomeCode::NoKrlProgram:
      return std::string(
                 "start: the controller shows no sign of the KRL program of krl_convention ") +
             fri::nameOf(o.convention) +
             "; start it on the pendant or set krl_convention to the one it runs";
    case OutcomeCode::ProgramRefused:
      return word + ": the KRL program refused after " + seconds + ": " + wordsFor(o.result);
    case OutcomeCode::NotEntered:
      return std::string("start: still in ") + fri::nameOf(o.state) + " after " + seconds +
             ", CMD expected; quality " + fri::nameOf(o.quality) +
             (o.drive_error != 0 ? ", drive errors" : "") +
             "; read the messages on the pendant, and check that krl_convention (" +
             fri::nameOf(o.convention) + ") is that of the running program";
    case OutcomeCode::NoPower: {
      char power[16];
      std::snprintf(power, sizeof power, "0x%02X", o.power);
      return word + ": command mode, but drive power is " + power + " instead of 0x7F after " +
             seconds + "; press the enabling switch or switch the drives on";
    }
    case OutcomeCode::WrongStrategy:
      return word + ": the controller is in " + fri::nameOf(o.reported) + " instead of " +
             fri::nameOf(o.wanted) + "; monitor mode was requested";
    case OutcomeCode::NotLeft:
      return word + ": still in " + fri::nameOf(o.state) + " after " + seconds +
             ", MON expected; stop the KRL program on the pendant";
  }
  return word;
}

coglab_rt::ReasonCode codeOf(OutcomeCode code) {
  using coglab_rt::ReasonCode;
  switch (code) {
    case OutcomeCode::Pending:
    case OutcomeCode::Done:
    case OutcomeCode::AlreadyThere:
      return ReasonCode::None;
    case OutcomeCode::Held:
      return ReasonCode::Held;
    case OutcomeCode::Busy:
    case OutcomeCode::InCommandMode:
      return ReasonCode::Busy;
    case OutcomeCode::NotSupported:
    case OutcomeCode::NoKrlProgram:
    case OutcomeCode::WrongStrategy:
      return ReasonCode::NotSupported;
    case OutcomeCode::PoorQuality:
      return ReasonCode::PoorQuality;
    case OutcomeCode::ProgramRefused:
    case OutcomeCode::NotEntered:
      return ReasonCode::NotInCommandMode;
    case OutcomeCode::NoPower:
      return ReasonCode::NoPower;
    case OutcomeCode::NotLeft:
      return ReasonCode::TimeLimit;
    case OutcomeCode::Interrupted:
      return ReasonCode::Cancelled;
    case OutcomeCode::Disconnected:
    case OutcomeCode::LostConnection:
      return ReasonCode::RobotDisconnected;
    case OutcomeCode::NotServed:
      break;
  }
  return ReasonCode::NotAdopted;
}

}  // namespace lwr_fri_bridge
