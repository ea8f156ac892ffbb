#include "lwr_fri_bridge/fri/krl_convention.hpp"

#include <array>
#include <stdexcept>

namespace lwr_fri_bridge::fri {
namespace {

constexpr std::array<const char*, 6> kNames = {"coglab",    "centro_epiaggio", "stanford",
                                               "rcprg_tum", "rtt_lwr",         "openkc"};

// KRL indices begin at 1.
std::int32_t& intAt(UserData& data, int krl_index) { return data.ints[krl_index - 1]; }
std::int32_t intAt(const UserData& data, int krl_index) { return data.ints[krl_index - 1]; }
bool boolAt(const UserData& data, int krl_index) {
  return ((data.bools >> (krl_index - 1)) & 1) != 0;
}

void setBool(UserData& data, int krl_index, bool value) {
  const auto bit = static_cast<std::uint16_t>(1U << (krl_index - 1));
  data.bools = static_cast<std::uint16_t>(value ? data.bools | bit : data.bools & ~bit);
}

bool isRequest(KrlPhase phase) { return phase == KrlPhase::Start || phase == KrlPhase::Stop; }

/// Next command of openkc in this phase; 0: none is left.
std::int32_t openKcCommand(const KrlRequest& request) {
  constexpr std::int32_t kStart = 1, kStop = 2, kCartesian = 6, kJoint = 7, kPosition = 9;
  if (request.phase == KrlPhase::Stop) return request.acknowledged == 0 ? kStop : 0;
  if (request.phase != KrlPhase::Start) return 0;
  if (request.acknowledged == 1) return kStart;
  if (request.acknowledged > 1) return 0;
  switch (request.strategy) {
    case ControlStrategy::CartesianImpedance:
      return kCartesian;
    case ControlStrategy::JointImpedance:
      return kJoint;
    default:
      return kPosition;
  }
}

}  // namespace

void stepRequest(KrlConvention convention, KrlRequest& request, const UserData& from) {
  if (convention != KrlConvention::OpenKc) return;
  const std::int32_t command = openKcCommand(request);
  const bool answers = boolAt(from, 1);
  if (request.asserted && answers && command != 0 && intAt(from, 15) == command) {
    ++request.acknowledged;
    request.asserted = false;
  } else if (command == 0) {
    request.asserted = false;
  } else if (!answers) {
    request.asserted = true;
  }
}

void writeRequest(KrlConvention convention, const KrlRequest& request, UserData& to) {
  const std::int32_t strategy = 10 * static_cast<std::int32_t>(request.strategy);
  const std::int32_t start_or_stop = request.phase == KrlPhase::Start  ? 1
                                     : request.phase == KrlPhase::Stop ? 2
                                                                       : 0;
  const bool wants_command = request.phase == KrlPhase::Start || request.phase == KrlPhase::Running;
  switch (convention) {
    case KrlConvention::Coglab:
      intAt(to, 1) = start_or_stop;
      intAt(to, 2) = strategy;
      intAt(to, 3) = request.number;
      break;
    case KrlConvention::CentroEpiaggio:
      intAt(to, 1) = strategy;
      intAt(to, 2) = wants_command ? 1 : 0;
      break;
    case KrlConvention::Stanford:
      // 20 also while idle: an old 10 would restart the robot after a fall-back to monitor mode.
      intAt(to, 15) = strategy;
      intAt(to, 16) = wants_command ? 10 : 20;
      break;
    case KrlConvention::RcprgTum:
      intAt(to, 1) = start_or_stop;
      setBool(to, 1, isRequest(request.phase));
      setBool(to, 8, request.phase == KrlPhase::Running);
      break;
    case KrlConvention::RttLwr:
      intAt(to, 1) = start_or_stop;
      intAt(to, 2) = strategy;
      intAt(to, 3) = request.tool;
      break;
    case KrlConvention::OpenKc:
      setBool(to, 1, request.asserted);
      intAt(to, 16) = request.asserted ? openKcCommand(request) : 0;
      break;
  }
}

KrlReply readReply(KrlConvention convention, const KrlRequest& request, const UserData& from) {
  KrlReply reply;
  switch (convention) {
    case KrlConvention::Coglab:
      reply.known = intAt(from, 16) == kCoglabProgramMark;
      reply.busy = intAt(from, 3) == request.number;
      if (isRequest(request.phase) && intAt(from, 1) == request.number) {
        reply.result = static_cast<KrlResult>(intAt(from, 2));
        reply.refused = intAt(from, 2) < 0;
      }
      break;
    case KrlConvention::RcprgTum:
      reply.busy = boolAt(from, 1);
      break;
    case KrlConvention::CentroEpiaggio:
    case KrlConvention::Stanford:
    case KrlConvention::RttLwr:
    case KrlConvention::OpenKc:
      break;  // these programs show only their mode, not the state of a request
  }
  return reply;
}

bool supports(KrlConvention convention, ControlStrategy strategy) {
  if (strategy == ControlStrategy::Other) return false;
  return convention != KrlConvention::RcprgTum || strategy == ControlStrategy::JointImpedance;
}

const char* nameOf(KrlConvention convention) {
  return kNames[static_cast<std::size_t>(convention)];
}

KrlConvention krlConventionFromName(const std::string& name) {
  std::string known;
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (name == kNames[i]) return static_cast<KrlConvention>(i);
    known += std::string(i == 0 ? "" : ", ") + kNames[i];
  }
  throw std::invalid_argument("unknown krl_convention '" + name + "'; known: " + known);
}

}  // namespace lwr_fri_bridge::fri
