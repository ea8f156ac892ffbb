#pragma once

#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "ctrl_more/controller/feedback_controller.hpp"
#include "ctrl_more/cycle/controller_status.hpp"

namespace ctrl_more {

struct Roster;

/// What services may ask of a manager. Unknown names throw std::invalid_argument with the nearest
/// known one.
class ControllerQuestions : public ControllerOwner {
 public:
  ~ControllerQuestions() override;

  /// As requested.
  bool isEnabled(const std::string& name) const override;
  /// For any reason, a latched fault included.
  bool isPaused(const std::string& name) const override;
  /// Gains as last requested.
  GainValues getGains(const std::string& name) const override;
  /// True if loaded.
  bool has(const std::string& name) const;
  /// Loaded, in load order.
  std::vector<std::string> getControllersNames() const;
  /// Loaded, in execution order.
  std::vector<std::string> getExecutionOrder() const;
  /// Names of the profiles.
  std::vector<std::string> getProfiles() const;
  /// True if it exists.
  bool hasProfile(const std::string& profile) const;
  /// Union of `map/key` over loaded (or enabled) controllers, sorted.
  std::vector<std::string> getUsedRobotStates(bool enabled_only = false) const;
  /// Union of `container/key` over loaded (or enabled) controllers, sorted.
  std::vector<std::string> getUsedControlStates(bool enabled_only = false) const;
  /// Declaration of one controller.
  Description describe(const std::string& name) const;
  /// One controller.
  ControllerStatus status(const std::string& name) const;
  /// All, in execution order.
  std::vector<ControllerStatus> statusAll() const;
  /// Prints one controller.
  void plot(const std::string& name, std::ostream& out) const;
  /// Prints all, in execution order.
  void plotAll(std::ostream& out) const;

 protected:
  ControllerQuestions();

  /// The loaded controllers.
  const std::unique_ptr<Roster> roster_;
};

}  // namespace ctrl_more
