#include "lwr_fri_bridge/requests/target_command.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>

namespace lwr_fri_bridge {
namespace {

std::string seconds(std::int64_t ns) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g s", 1e-9 * static_cast<double>(ns));
  return text;
}

/// Sorts the velocities into wire order. Returns an error message, empty if there is no error.
std::string sorted(const TargetMessage& message, Vector7& velocity) {
  if (message.velocities.size() != 7)
    return "expected 7 velocities, got " + std::to_string(message.velocities.size());
  if (!message.names.empty() && message.names.size() != 7)
    return "expected 7 names or none, got " + std::to_string(message.names.size());
  velocity.setConstant(NAN);
  for (std::size_t i = 0; i < 7; ++i) {
    std::size_t joint = i;
    if (!message.names.empty()) {
      joint = 0;
      while (joint < 7 && message.names[i] != kJointNames[joint]) ++joint;
      if (joint == 7) {
        return "unknown joint '" + message.names[i] +
               "', expected lwr_a1 lwr_a2 lwr_e1 lwr_a3 lwr_a4 lwr_a5 lwr_a6";
      }
    }
    velocity[static_cast<Eigen::Index>(joint)] = message.velocities[i];
  }
  return velocity.allFinite() ? "" : "a velocity is not finite, or a joint is named twice";
}

std::string wrongStamp(const TargetMessage& message, const TargetPermission& permission) {
  if (!message.stamped) {
    return "header.stamp is zero; stamp each message with its creation time (rostopic pub -s "
           "with 'header: auto')";
  }
  if (message.age_ns > permission.longest_ns) {
    return "made " + seconds(message.age_ns) + " ago, at most " + seconds(permission.longest_ns) +
           " (topic_timeout) is followed; does the publisher run late, are the clocks of both "
           "computers synchronised?";
  }
  if (message.age_ns < -kFutureAllowance_ns) {
    return "stamped " + seconds(-message.age_ns) + " ahead of this computer's clock; at most " +
           seconds(kFutureAllowance_ns) +
           " is taken; are the clocks of both computers synchronised?";
  }
  return {};
}

}  // namespace

TargetVerdict judgeTarget(const TargetMessage& message, const TargetPermission& permission) {
  TargetVerdict verdict;
  const auto refuse = [&verdict](TargetFault fault, std::string sentence) {
    verdict.fault = fault;
    verdict.sentence = std::move(sentence);
    return verdict;
  };
  const std::string invalid = sorted(message, verdict.command.velocity);
  if (!invalid.empty()) return refuse(TargetFault::Invalid, invalid);
  const std::string stamp = wrongStamp(message, permission);
  if (!stamp.empty()) return refuse(TargetFault::Stamp, stamp);

  verdict.command.stamp_ns = permission.now_ns - std::max<std::int64_t>(message.age_ns, 0);
  verdict.command.motion_epoch = permission.epoch;
  if (message.epoch.empty()) {
    if (verdict.command.stamp_ns < permission.since_ns)
      return refuse(TargetFault::Epoch, "made before motion was allowed; request the motion again");
    return verdict;
  }
  std::uint32_t epoch = 0;
  const char* const end = message.epoch.data() + message.epoch.size();
  const auto [parsed, error] = std::from_chars(message.epoch.data(), end, epoch);
  if (error != std::errc() || parsed != end) {
    return refuse(TargetFault::Invalid, "header.frame_id is '" + message.epoch.substr(0, 32) +
                                            "', expected the motion_epoch of state, or nothing");
  }
  if (epoch != permission.epoch) {
    return refuse(TargetFault::Epoch, "made in motion_epoch " + message.epoch + ", now it is " +
                                          std::to_string(permission.epoch) +
                                          "; request the motion again");
  }
  return verdict;
}

}  // namespace lwr_fri_bridge
