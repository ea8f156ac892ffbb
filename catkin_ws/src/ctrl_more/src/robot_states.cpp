#include "ctrl_more/robot_states.hpp"

#include <algorithm>
#include <cmath>

#include "ctrl_more/config_node.hpp"
#include "ctrl_more/logger.hpp"

namespace ctrl_more {
namespace {

std::string quoted(RobotSource source, const std::string& key) {
  return std::string(nameOf(source)) + " '" + key + "'";
}

const char* stampMapOf(RobotSource source) {
  return source == RobotSource::Measured ? "measurementTimeStamp" : "estimateTimeStamp";
}

}  // namespace

RobotStates::RobotStates(Logger* logger) : logger_(logger ? logger : &Logger::standard()) {}

Status RobotStates::refuse(const std::string& text) const {
  logger_->log(LogLevel::Warning, "RobotStates", text);
  return Status::failure(text);
}

std::string RobotStates::unknownKey(RobotSource source, const std::string& key,
                                    const char* who) const {
  std::vector<std::string> known;
  for (const auto& entry : index(source)) known.push_back(entry.first);
  std::sort(known.begin(), known.end());
  return std::string(who) + ": " + nameOf(source) + " has no key '" + key + "'" +
         suggestion(key, known);
}

Status RobotStates::add(RobotSource source, const std::string& key, int size,
                        const std::string& unit, const std::string& frame, const char* who) {
  if (key.empty() || size <= 0) {
    return refuse(std::string(who) + ": a key of " + nameOf(source) +
                  " needs a name and at least one number, got name '" + key + "' and size " +
                  std::to_string(size));
  }
  if (frozen_) {
    return refuse(unknownKey(source, key, who) +
                  "; the states are frozen: declare it before the first cycle");
  }
  Entry entry;
  entry.source = source;
  entry.info = {key, unit, frame, static_cast<std::uint32_t>(data_.size()),
                static_cast<std::uint32_t>(size), SignalKind::Vector};
  index_[static_cast<int>(source)][key] = static_cast<std::uint32_t>(entries_.size());
  entries_.push_back(entry);
  data_.resize(data_.size() + size, 0.0);
  stamps_.push_back(kNeverWritten);
  logger_->log(LogLevel::Info, "RobotStates",
               "new key " + quoted(source, key) + " of size " + std::to_string(size) +
                   ", added by " + who);
  return {};
}

Status RobotStates::declare(RobotSource source, const std::string& key, int size,
                            const std::string& unit, const std::string& frame) {
  const auto found = index(source).find(key);
  if (found == index(source).end()) return add(source, key, size, unit, frame, "declare");
  SignalInfo& info = entries_[found->second].info;
  if (static_cast<int>(info.size) != size) {
    return refuse("declare: " + quoted(source, key) + " has size " + std::to_string(info.size) +
                  ", got " + std::to_string(size) + "; a key keeps its size");
  }
  if (info.unit.empty()) info.unit = unit;
  if (info.frame.empty()) info.frame = frame;
  return {};
}

Status RobotStates::set(RobotSource source, const std::string& key,
                        const Eigen::Ref<const Eigen::VectorXd>& value, std::int64_t stamp_ns,
                        const char* who) {
  if (stamp_ns < 0) {
    return refuse(std::string(who) + ": stamp of " + quoted(source, key) +
                  " must be monotonic nanoseconds >= 0, got " + std::to_string(stamp_ns));
  }
  if (!value.allFinite()) {
    return refuse(std::string(who) + ": " + quoted(source, key) +
                  " got a number that is not finite; the old value stays");
  }
  auto found = index(source).find(key);
  if (found == index(source).end()) {
    const Status added = add(source, key, static_cast<int>(value.size()), "", "", who);
    if (!added) return added;
    found = index(source).find(key);
  }
  const SignalInfo& info = entries_[found->second].info;
  if (value.size() != static_cast<Eigen::Index>(info.size)) {
    return refuse(std::string(who) + ": " + quoted(source, key) + " expects " +
                  std::to_string(info.size) + " numbers, got " + std::to_string(value.size()) +
                  "; the old value stays");
  }
  std::copy(value.data(), value.data() + value.size(), data_.begin() + info.offset);
  stamps_[found->second] = stamp_ns;
  newest_ = std::max(newest_, stamp_ns);
  return {};
}

Status RobotStates::get(RobotSource source, const std::string& key, Eigen::VectorXd& value,
                        std::int64_t* stamp_ns, const char* who) const {
  const auto found = index(source).find(key);
  if (found == index(source).end()) return refuse(unknownKey(source, key, who));
  const SignalInfo& info = entries_[found->second].info;
  value = Eigen::Map<const Eigen::VectorXd>(data_.data() + info.offset, info.size);
  if (stamp_ns) *stamp_ns = stamps_[found->second];
  return {};
}

Status RobotStates::setStamp(RobotSource source, const std::string& key, std::int64_t stamp_ns,
                             const char* who) {
  const auto found = index(source).find(key);
  if (found == index(source).end()) {
    return refuse(std::string("a key of ") + stampMapOf(source) +
                  " must exist in its data map: " + unknownKey(source, key, who));
  }
  if (stamp_ns < 0) {
    return refuse(std::string(who) + ": stamp of " + quoted(source, key) +
                  " must be monotonic nanoseconds >= 0, got " + std::to_string(stamp_ns));
  }
  stamps_[found->second] = stamp_ns;
  newest_ = std::max(newest_, stamp_ns);
  return {};
}

Status RobotStates::setMeasuredData(const std::string& key,
                                    const Eigen::Ref<const Eigen::VectorXd>& value,
                                    std::int64_t stamp_ns, const char* who) {
  return set(RobotSource::Measured, key, value, stamp_ns, who);
}

Status RobotStates::setEstimatedData(const std::string& key,
                                     const Eigen::Ref<const Eigen::VectorXd>& value,
                                     std::int64_t stamp_ns, const char* who) {
  return set(RobotSource::Estimated, key, value, stamp_ns, who);
}

Status RobotStates::getMeasuredData(const std::string& key, Eigen::VectorXd& value,
                                    const char* who) const {
  return get(RobotSource::Measured, key, value, nullptr, who);
}

Status RobotStates::getMeasuredData(const std::string& key, Eigen::VectorXd& value,
                                    std::int64_t& stamp_ns, const char* who) const {
  return get(RobotSource::Measured, key, value, &stamp_ns, who);
}

Status RobotStates::getEstimatedData(const std::string& key, Eigen::VectorXd& value,
                                     const char* who) const {
  return get(RobotSource::Estimated, key, value, nullptr, who);
}

Status RobotStates::getEstimatedData(const std::string& key, Eigen::VectorXd& value,
                                     std::int64_t& stamp_ns, const char* who) const {
  return get(RobotSource::Estimated, key, value, &stamp_ns, who);
}

Status RobotStates::setMeasurementTimeStamp(const std::string& key, std::int64_t stamp_ns,
                                            const char* who) {
  return setStamp(RobotSource::Measured, key, stamp_ns, who);
}

Status RobotStates::setEstimateTimeStamp(const std::string& key, std::int64_t stamp_ns,
                                         const char* who) {
  return setStamp(RobotSource::Estimated, key, stamp_ns, who);
}

RobotSignal RobotStates::find(RobotSource source, const std::string& key) const {
  RobotSignal signal;
  const auto found = index(source).find(key);
  if (found == index(source).end()) return signal;
  signal.offset_ = entries_[found->second].info.offset;
  signal.size_ = entries_[found->second].info.size;
  signal.index_ = found->second;
  return signal;
}

bool RobotStates::write(RobotSignal signal, const double* values, std::int64_t stamp_ns) {
  if (!signal.valid() || stamp_ns < 0) return false;
  for (std::uint32_t i = 0; i < signal.size_; ++i) {
    if (!std::isfinite(values[i])) return false;
  }
  std::copy(values, values + signal.size_, data_.begin() + signal.offset_);
  stamps_[signal.index_] = stamp_ns;
  newest_ = std::max(newest_, stamp_ns);
  return true;
}

std::vector<SignalInfo> RobotStates::signals(RobotSource source) const {
  std::vector<SignalInfo> list;
  for (const Entry& entry : entries_) {
    if (entry.source == source) list.push_back(entry.info);
  }
  return list;
}

void RobotStates::print(std::ostream& out, std::int64_t now_ns) const {
  const std::int64_t now = now_ns == kNeverWritten ? newest_ : now_ns;
  for (const RobotSource source : {RobotSource::Measured, RobotSource::Estimated}) {
    out << nameOf(source) << '\n';
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const Entry& entry = entries_[i];
      if (entry.source != source) continue;
      out << "  " << entry.info.key << " [" << entry.info.size << "]";
      if (!entry.info.unit.empty()) out << " (" << entry.info.unit << ')';
      if (!entry.info.frame.empty()) out << " in " << entry.info.frame;
      if (stamps_[i] == kNeverWritten) {
        out << ": never written\n";
        continue;
      }
      out << ", age " << 1e-6 * static_cast<double>(now - stamps_[i]) << " ms:";
      for (std::uint32_t k = 0; k < entry.info.size; ++k) {
        out << ' ' << data_[entry.info.offset + k];
      }
      out << '\n';
    }
  }
}

}  // namespace ctrl_more
