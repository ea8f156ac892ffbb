#include "ctrl_more/states/robot_states.hpp"

#include <algorithm>
#include <cmath>

#include "ctrl_more/log/logger.hpp"

namespace ctrl_more {

RobotStates::RobotStates(Logger* logger) : table_("RobotStates", logger) {}

Status RobotStates::declare(RobotSource source, const std::string& key, int size,
                            const std::string& unit, const std::string& frame) {
  const Status status = table_.declare(groupOf(source), key, size, unit, frame);
  stamps_.resize(table_.entries().size(), kNeverWritten);
  return status;
}

void RobotStates::stampSignal(std::uint32_t index, std::int64_t stamp_ns) {
  stamps_[index] = stamp_ns;
  newest_ = std::max(newest_, stamp_ns);
}

Status RobotStates::set(RobotSource source, const std::string& key, const Values& value,
                        std::int64_t stamp_ns, const char* who) {
  if (stamp_ns < 0) {
    return table_.refuse(std::string(who) + ": stamp of " + nameOf(source) + "/" + key +
                         " must be monotonic nanoseconds >= 0, got " + std::to_string(stamp_ns));
  }
  const Status status = table_.set(groupOf(source), key, value, who);
  if (!status) return status;
  stamps_.resize(table_.entries().size(), kNeverWritten);
  stampSignal(find(source, key).index(), stamp_ns);
  return {};
}

Status RobotStates::get(RobotSource source, const std::string& key, Eigen::VectorXd& value,
                        std::int64_t* stamp_ns, const char* who) const {
  const Status status = table_.get(groupOf(source), key, value, who);
  if (status && stamp_ns) *stamp_ns = stamp(find(source, key));
  return status;
}

Status RobotStates::setStamp(RobotSource source, const std::string& key, std::int64_t stamp_ns,
                             const char* who) {
  const RobotSignal signal = find(source, key);
  if (!signal.valid()) {
    return table_.refuse("a stamp needs its data first: " +
                         table_.unknownKey(groupOf(source), key, who));
  }
  if (stamp_ns < 0) {
    return table_.refuse(std::string(who) + ": stamp of " + nameOf(source) + "/" + key +
                         " must be monotonic nanoseconds >= 0, got " + std::to_string(stamp_ns));
  }
  stampSignal(signal.index(), stamp_ns);
  return {};
}

RobotSignal RobotStates::find(RobotSource source, const std::string& key) const {
  return RobotSignal(table_.find(groupOf(source), key));
}

bool RobotStates::write(RobotSignal signal, const double* values, std::int64_t stamp_ns) {
  if (!signal.valid() || stamp_ns < 0) return false;
  if (!std::all_of(values, values + signal.size(), [](double v) { return std::isfinite(v); })) {
    return false;
  }
  std::copy(values, values + signal.size(), table_.data().begin() + signal.offset());
  stampSignal(signal.index(), stamp_ns);
  return true;
}

std::vector<SignalInfo> RobotStates::signals(RobotSource source) const {
  return table_.signals(groupOf(source));
}

void RobotStates::print(std::ostream& out, std::int64_t now_ns) const {
  const std::int64_t now = now_ns == kNeverWritten ? newest_ : now_ns;
  for (const RobotSource source : {RobotSource::Measured, RobotSource::Estimated}) {
    out << nameOf(source) << '\n';
    for (const SignalInfo& info : signals(source)) {
      const std::int64_t written = stamp(find(source, info.key));
      out << "  " << SignalTable::label(info);
      if (written == kNeverWritten) {
        out << ": never written\n";
      } else {
        out << ", age " << 1e-6 * static_cast<double>(now - written)
            << " ms:" << table_.numbers(info) << '\n';
      }
    }
  }
}

}  // namespace ctrl_more
