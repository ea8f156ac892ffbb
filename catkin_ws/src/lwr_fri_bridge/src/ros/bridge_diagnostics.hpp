/// @file
/// The bridge's part of /diagnostics.
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>

#include "lwr_fri_bridge/ros/bridge_ros.hpp"

namespace lwr_fri_bridge {

/// Publishes four statuses: connection, computer, arm, commands.
class BridgeDiagnostics {
 public:
  explicit BridgeDiagnostics(BridgeRos& owner);

  /// Publishes now. The caller's timer sets the rate.
  void publish() { updater_.force_update(); }

 private:
  void connection(diagnostic_updater::DiagnosticStatusWrapper& status);
  void computer(diagnostic_updater::DiagnosticStatusWrapper& status);
  void arm(diagnostic_updater::DiagnosticStatusWrapper& status);
  void commands(diagnostic_updater::DiagnosticStatusWrapper& status);

  BridgeRos& owner_;
  const double hot_;  // degree Celsius
  diagnostic_updater::Updater updater_;
  std::uint64_t refused_before_ = 0, late_before_ = 0, answers_before_ = 0;
};

}  // namespace lwr_fri_bridge
