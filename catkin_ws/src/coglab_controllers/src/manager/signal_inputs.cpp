#include "coglab_controllers/manager/signal_inputs.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

namespace coglab_controllers {
namespace {

std::int64_t nanoseconds(double seconds) { return static_cast<std::int64_t>(1e9 * seconds); }

/// True for fields that end with a quaternion x y z w.
bool hasQuaternion(const SignalField& field) {
  return field.name == "orientation" || field.name == "pose";
}

/// Appends the numbers of one pick to `values`. Returns the error; empty: none.
std::string gather(const SignalPick& pick, const SignalField& field, const SignalMessage& message,
                   std::vector<double>& values) {
  const SignalMessage::Field& given = message.fields[pick.field];
  if (given.size == 0) return "the message has no " + field.name;
  if (pick.parts.empty() && pick.joints.empty()) {
    if (hasQuaternion(field)) {
      const double* const q = given.numbers + given.size - 4;
      const double length = std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3]));
      if (!(std::abs(length - 1.0) <= 0.01)) {
        return "expected a unit quaternion in " + field.name + ", got one of length " +
               std::to_string(length);
      }
    }
    values.insert(values.end(), given.numbers, given.numbers + given.size);
    return "";
  }
  for (const std::size_t part : pick.parts) {
    if (part >= given.size) {
      return field.name + " has " + std::to_string(given.size) + " numbers, none at index " +
             std::to_string(part);
    }
    values.push_back(given.numbers[part]);
  }
  for (const std::string& joint : pick.joints) {
    const auto& names = message.joint_names;
    const auto found = std::find(names.begin(), names.end(), joint);
    const auto at = static_cast<std::size_t>(found - names.begin());
    if (found == names.end() || at >= given.size) {
      return field.name + " of joint '" + joint + "' is not in the message";
    }
    values.push_back(given.numbers[at]);
  }
  return "";
}

}  // namespace

SignalInputs::Box::Box(const SignalInput& row, ctrl_more::RobotSignal signal)
    : mailbox(signal, nanoseconds(row.max_age)) {
  values.reserve(static_cast<std::size_t>(row.size));
}

ctrl_more::Status SignalInputs::add(const std::vector<SignalInput>& rows,
                                    ctrl_more::RobotStates& robot) {
  std::set<std::pair<ctrl_more::RobotSource, std::string>> keys;
  for (const SignalInput& row : rows) {
    if (robot.find(row.source, row.key).valid() || !keys.insert({row.source, row.key}).second) {
      return ctrl_more::Status::failure(std::string(ctrl_more::nameOf(row.source)) + "/" + row.key +
                                        " has a writer already; give topic " + row.topic +
                                        " another key");
    }
  }
  for (const SignalInput& row : rows) {
    const ctrl_more::Status declared =
        robot.declare(row.source, row.key, row.size, row.unit, row.frame);
    if (!declared) return declared;
    rows_.push_back(row);
    boxes_.emplace_back(row, robot.find(row.source, row.key));
  }
  return {};
}

SignalPost SignalInputs::post(std::size_t index, const SignalMessage& message,
                              std::int64_t now_ns) {
  const SignalInput& row = rows_[index];
  Box& box = boxes_[index];
  if (!row.frame.empty() && message.frame != row.frame) {
    return {SignalRefusal::Frame, "expected frame " + row.frame + ", got '" + message.frame + "'"};
  }
  box.values.clear();
  for (const SignalPick& pick : row.picks) {
    std::string missing = gather(pick, row.type->fields[pick.field], message, box.values);
    if (!missing.empty()) return {SignalRefusal::Missing, std::move(missing)};
  }
  if (box.values.size() != static_cast<std::size_t>(row.size)) {
    return {SignalRefusal::Size, "expected " + std::to_string(row.size) + " numbers, got " +
                                     std::to_string(box.values.size())};
  }
  if (!std::all_of(box.values.begin(), box.values.end(),
                   [](double value) { return std::isfinite(value); })) {
    return {SignalRefusal::NotFinite, "expected finite numbers, got one that is not"};
  }
  const std::int64_t stamp = row.stamp_header ? message.stamp_ns : now_ns;
  if (stamp == 0) {
    return {SignalRefusal::NoStamp,
            "the header has no stamp; its publisher must set one, or the row needs `stamp: "
            "arrival`"};
  }
  if (stamp - now_ns > ctrl_more::RobotStates::kMostAhead) {
    return {SignalRefusal::Future,
            "its stamp is ahead of this computer's clock; synchronise the clocks, or set `stamp: "
            "arrival`"};
  }
  const std::int64_t before = box.newest.load(std::memory_order_relaxed);
  // Also refuses a stamp that converts to a time before the start of the clock.
  if (stamp < 0 || stamp <= before || now_ns - stamp > nanoseconds(row.max_age)) {
    return {SignalRefusal::Past,
            stamp < 0 || now_ns - stamp > nanoseconds(row.max_age)
                ? "its stamp is older than max_age, " + std::to_string(row.max_age) + " s"
                : "its stamp is not newer than that of the message before"};
  }
  box.mailbox.post(box.values.data(), row.size, stamp);
  box.newest.store(stamp, std::memory_order_relaxed);
  return {};
}

}  // namespace coglab_controllers
