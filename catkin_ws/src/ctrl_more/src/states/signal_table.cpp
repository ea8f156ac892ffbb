#include "ctrl_more/states/signal_table.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "ctrl_more/log/logger.hpp"
#include "ctrl_more/log/words.hpp"
#include "ctrl_more/states/handles.hpp"

namespace ctrl_more {
namespace {

constexpr double kUnitTolerance = 1e-6;

std::string fullName(const SignalGroup& group, const std::string& key) {
  return group.name + ("/" + key);
}

bool isUnit(const Eigen::Vector4d& q) {
  return std::abs(q.squaredNorm() - 1.0) <= 2.0 * kUnitTolerance;
}

}  // namespace

SignalTable::SignalTable(const char* store, Logger* logger)
    : store_(store), logger_(logger ? logger : &Logger::standard()) {}

Status SignalTable::refuse(const std::string& text) const {
  logger_->log(LogLevel::Warning, store_, text);
  return Status::failure(text);
}

std::string SignalTable::unknownKey(const SignalGroup& group, const std::string& key,
                                    const char* who) const {
  std::vector<std::string> known;
  for (const SignalInfo& info : signals(group)) known.push_back(info.key);
  std::sort(known.begin(), known.end());
  return std::string(who) + ": " + group.name + " has no key '" + key + "'" +
         suggestion(key, known);
}

Status SignalTable::add(const SignalGroup& group, const std::string& key, int size,
                        const std::string& unit, const std::string& frame, const char* who,
                        bool announce) {
  const std::string name = fullName(group, key);
  const std::string what = std::string(who) + ": " + name;
  if (key.empty() || size <= 0) {
    return refuse(what + " needs a name and at least one number, got size " + std::to_string(size));
  }
  if (group.size != 0 && size != group.size) {
    return refuse(what + " expects " + std::to_string(group.size) + " numbers, got " +
                  std::to_string(size));
  }
  if (frozen_) {
    return refuse(unknownKey(group, key, who) +
                  "; the states are frozen: declare it before the first cycle");
  }
  const Entry entry{&group,
                    {key, unit, frame, static_cast<std::uint32_t>(data_.size()),
                     static_cast<std::uint32_t>(size), group.kind}};
  index_[name] = static_cast<std::uint32_t>(entries_.size());
  entries_.push_back(entry);
  data_.resize(data_.size() + size, 0.0);
  // The initial value of a quaternion is the identity, not zero.
  if (group.kind != SignalKind::Vector) data_.back() = 1.0;
  if (announce) {
    logger_->log(LogLevel::Info, store_,
                 "new key " + name + " of size " + std::to_string(size) + ", added by " + who);
  }
  return {};
}

Status SignalTable::declare(const SignalGroup& group, const std::string& key, int size,
                            const std::string& unit, const std::string& frame, bool announce) {
  const auto found = index_.find(fullName(group, key));
  if (found == index_.end()) return add(group, key, size, unit, frame, "declare", announce);
  SignalInfo& info = entries_[found->second].info;
  if (static_cast<int>(info.size) != size) {
    return refuse("declare: " + found->first + " has size " + std::to_string(info.size) + ", got " +
                  std::to_string(size) + "; a key keeps its size");
  }
  if (info.unit.empty()) info.unit = unit;
  if (info.frame.empty()) info.frame = frame;
  return {};
}

Status SignalTable::set(const SignalGroup& group, const std::string& key,
                        const Eigen::Ref<const Eigen::VectorXd>& value, const char* who) {
  const std::string what = std::string(who) + ": " + fullName(group, key);
  Signal signal = find(group, key);
  const int fixed = group.size != 0 ? group.size : static_cast<int>(value.size());
  const int expected = signal.valid() ? signal.size() : fixed;
  if (value.size() != expected) {
    return refuse(what + " expects " + std::to_string(expected) + " numbers, got " +
                  std::to_string(value.size()) + "; the old value stays");
  }
  if (!value.allFinite()) {
    return refuse(what + " got a number that is not finite; the old value stays");
  }
  if (group.kind != SignalKind::Vector && !isUnit(value.tail<4>())) {
    return refuse(what + " expects a unit quaternion x y z w, got norm " +
                  std::to_string(value.tail<4>().norm()) + "; normalise it first");
  }
  if (!signal.valid()) {
    const Status added = add(group, key, expected, "", "", who, true);
    if (!added) return added;
    signal = find(group, key);
  }
  std::copy(value.data(), value.data() + value.size(), data_.begin() + signal.offset());
  return {};
}

Status SignalTable::get(const SignalGroup& group, const std::string& key, Eigen::VectorXd& value,
                        const char* who) const {
  const Signal signal = find(group, key);
  if (!signal.valid()) return refuse(unknownKey(group, key, who));
  value = Eigen::Map<const Eigen::VectorXd>(data_.data() + signal.offset(), signal.size());
  return {};
}

Signal SignalTable::find(const SignalGroup& group, const std::string& key) const {
  Signal signal;
  const auto found = index_.find(fullName(group, key));
  if (found == index_.end()) return signal;
  signal.offset_ = entries_[found->second].info.offset;
  signal.size_ = entries_[found->second].info.size;
  signal.index_ = found->second;
  return signal;
}

std::vector<SignalInfo> SignalTable::signals(const SignalGroup& group) const {
  std::vector<SignalInfo> list;
  for (const Entry& entry : entries_) {
    if (entry.group == &group) list.push_back(entry.info);
  }
  return list;
}

std::string SignalTable::label(const SignalInfo& info) {
  std::string text = info.key + " [" + std::to_string(info.size) + "]";
  if (!info.unit.empty()) text += " (" + info.unit + ")";
  if (!info.frame.empty()) text += " in " + info.frame;
  return text;
}

std::string SignalTable::numbers(const SignalInfo& info) const {
  std::ostringstream out;
  for (std::uint32_t k = 0; k < info.size; ++k) out << ' ' << data_[info.offset + k];
  return out.str();
}

namespace {

std::string nameFor(const SignalTable::Entry* signal) {
  return signal != nullptr ? signal->name() : "the controller's state";
}

}  // namespace

void refuseSize(const SignalTable::Entry* signal, int expected, int given) {
  throw WrongSize("it gave " + std::to_string(given) + " numbers to " + nameFor(signal) +
                  ", expected a size of " + std::to_string(expected));
}

void refuseReach(const SignalTable::Entry* signal, int size, std::ptrdiff_t start,
                 std::ptrdiff_t count) {
  throw WrongSize("it reached beside " + nameFor(signal) + ": " + std::to_string(count) +
                  " from number " + std::to_string(start) + " on, expected a part of its " +
                  std::to_string(size));
}

}  // namespace ctrl_more
