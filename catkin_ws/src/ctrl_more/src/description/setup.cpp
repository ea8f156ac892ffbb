#include "ctrl_more/description/setup.hpp"

#include <algorithm>
#include <stdexcept>

#include "ctrl_more/log/words.hpp"

namespace ctrl_more {
namespace {

std::string listOf(const std::vector<int>& sizes) {
  std::string text;
  for (const int size : sizes) text += (text.empty() ? "" : " or ") + std::to_string(size);
  return text;
}

// Decides the size of a signal: the requested one, else the existing one, else the only declared
// one.
int decideSize(const std::string& what, const std::vector<int>& allowed, int asked, int existing) {
  const auto isAllowed = [&](int size) {
    return allowed.empty() || std::find(allowed.begin(), allowed.end(), size) != allowed.end();
  };
  if (asked != 0 && !isAllowed(asked)) {
    throw std::invalid_argument(what + ": size " + std::to_string(asked) + " was asked for, but " +
                                listOf(allowed) + " is declared");
  }
  const int expected = asked != 0 ? asked : (allowed.size() == 1 ? allowed[0] : 0);
  if (existing != 0) {
    if ((expected != 0 && existing != expected) || !isAllowed(existing)) {
      throw std::invalid_argument(what + " has size " + std::to_string(existing) +
                                  ", but the controller expects " +
                                  (expected != 0 ? std::to_string(expected) : listOf(allowed)));
    }
    return existing;
  }
  if (expected == 0) {
    throw std::invalid_argument(what + " does not exist yet and the controller accepts several " +
                                "sizes; declare it before loading the controller");
  }
  return expected;
}

}  // namespace

Setup::Setup(std::string name, const Description& description, const GainValues& gains,
             const SettingValues& settings, RobotStates& robot, ControlStates& control,
             std::uint32_t owner)
    : name_(std::move(name)),
      gains_(gains),
      settings_(settings),
      robot_(robot),
      control_(control),
      owner_(owner) {
  for (const RobotSignalUse& use : description.robot_signals) {
    robot_uses_.push_back({{use, keyOf(use.role, use.key_setting)}});
  }
  for (const ControlSignalUse& use : description.control_signals) {
    control_uses_.push_back({{use, keyOf(use.role, use.key_setting)}});
  }
}

std::string Setup::keyOf(const std::string& role, const std::string& key_setting) const {
  return key_setting.empty() ? role : settings_.text(key_setting);
}

// Decides the size of a signal, declares the signal and fetches its handle.
template <typename Entry, typename Store, typename Group>
void Setup::resolveIn(Store& store, Group group, Entry& entry, const std::vector<int>& allowed,
                      int size) {
  const std::string what = name_ + ": " + nameOf(group) + " '" + entry.key + "'";
  const int decided = decideSize(what, allowed, size, store.find(group, entry.key).size());
  const Status status = store.declare(group, entry.key, decided, entry.use.unit, entry.use.frame);
  if (!status) throw std::invalid_argument(name_ + ": " + status.message());
  entry.signal = store.find(group, entry.key);
}

void Setup::resolve(ResolvedRobotUse& entry, int size) {
  resolveIn(robot_, entry.use.source, entry, entry.use.sizes, size);
}

void Setup::resolve(ResolvedControlUse& entry, int size) {
  const int fixed = entry.use.container == ControlContainer::JointSpaceReference
                        ? control_.joints()
                        : fixedSizeOf(entry.use.container);
  std::vector<int> allowed = entry.use.sizes;
  if (allowed.empty() && fixed != 0) allowed = {fixed};
  resolveIn(control_, entry.use.container, entry, allowed, size);
}

RobotSignal Setup::robotSignal(const std::string& role, int size) {
  std::vector<std::string> known;
  for (ResolvedRobotUse& entry : robot_uses_) {
    known.push_back(entry.use.role);
    if (entry.use.role != role) continue;
    resolve(entry, size);
    return entry.signal;
  }
  throw std::invalid_argument(name_ + ": the description declares no robot signal '" + role + "'" +
                              suggestion(role, known));
}

ResolvedControlUse& Setup::findControl(const std::string& role) {
  std::vector<std::string> known;
  ResolvedControlUse* found = nullptr;
  for (ResolvedControlUse& entry : control_uses_) {
    const std::string full = std::string(nameOf(entry.use.container)) + "/" + entry.use.role;
    known.push_back(full);
    if (full == role) return entry;
    if (entry.use.role != role) continue;
    if (found) {
      throw std::invalid_argument(name_ + ": the role '" + role +
                                  "' is declared in two containers; write container/role");
    }
    found = &entry;
  }
  if (found) return *found;
  throw std::invalid_argument(name_ + ": the description declares no control signal '" + role +
                              "'" + suggestion(role, known));
}

ControlSignal Setup::controlSignal(const std::string& role, int size, bool to_modify) {
  ResolvedControlUse& entry = findControl(role);
  if (to_modify && !entry.use.modifies) {
    throw std::invalid_argument(name_ + ": the description declares control signal '" + role +
                                "' as read only");
  }
  resolve(entry, size);
  return entry.signal;
}

void Setup::resolveAll() {
  const auto resolve_or_drop = [this](auto& uses) {
    for (auto& entry : uses) {
      if (!entry.signal.valid() && !entry.use.if_asked) resolve(entry, 0);
    }
    uses.erase(std::remove_if(uses.begin(), uses.end(),
                              [](const auto& entry) { return !entry.signal.valid(); }),
               uses.end());
  };
  resolve_or_drop(robot_uses_);
  resolve_or_drop(control_uses_);
}

}  // namespace ctrl_more
