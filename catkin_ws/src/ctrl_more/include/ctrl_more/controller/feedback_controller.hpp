#pragma once

#include <map>
#include <ostream>
#include <string>
#include <vector>

#include "ctrl_more/controller/control_law.hpp"
#include "ctrl_more/description/change.hpp"
#include "ctrl_more/log/logger.hpp"
#include "ctrl_more/states/status.hpp"

namespace ctrl_more {

/// What Table I's control methods of a controller need from whoever manages it.
class ControllerOwner {
 public:
  virtual ~ControllerOwner() = default;
  /// Makes changes, all or nothing.
  virtual Status apply(const Change& change) = 0;
  /// True if the controller of this name is enabled.
  virtual bool isEnabled(const std::string& name) const = 0;
  /// True if it is paused for any reason, faults included.
  virtual bool isPaused(const std::string& name) const = 0;
  /// Its gains as last requested.
  virtual GainValues getGains(const std::string& name) const = 0;
};

/// A feedback controller: reads the robot's state and modifies references in the control cycle.
///
/// A developer writes a class with describe(), initialize() and update() (see ControlLaw),
/// registers it with CTRL_MORE_REGISTER_CONTROLLER (or with the paper's own maker, see
/// loading/prototypes.hpp), and compiles it into a library of its own. Everything of Table I of the
/// Ctrl-MORE paper is here; what only documents or administrates is implemented once, from the
/// description.
class FeedbackController : public ControlLaw {
 public:
  FeedbackController() = default;
  FeedbackController(const FeedbackController&) = delete;
  FeedbackController& operator=(const FeedbackController&) = delete;

  /// @name Documentation methods (Table I)
  /// @{

  /// Sets the name of the instance; refused once a manager has it, because names come from the
  /// list file then.
  Status setName(const std::string& name);
  /// Name of the instance, not of the class.
  const std::string& getName() const { return name_; }
  /// Prints the description, the present state, the gains and the signals.
  void plot(std::ostream& out) const;
  /// Declares a control signal that will be modified, in addition to describe().
  /// Only before initialize().
  /// @param name key of a well-known signal (`com`, `zmp`, `pelvis`, ...) or `container/key`
  Status addUsedControlState(const std::string& name);
  /// Declares a measured robot signal (or `estimatedData/key`) in addition to describe().
  /// Only before initialize().
  Status addUsedRobotState(const std::string& name);
  /// True if the robot signal is declared; by key, or by `measuredData/key`.
  bool isUsingRobotState(const std::string& name) const;
  /// True if the control signal is declared; by key, or by `container/key`.
  bool isUsingControlState(const std::string& name) const;
  /// Declared control signals with key, size, unit and access.
  std::vector<ResolvedControlUse> getUsedControlState() const;
  /// The same under the plural name.
  std::vector<ResolvedControlUse> getUsedControlStates() const { return getUsedControlState(); }
  /// Declared robot signals with key, size, unit and age.
  std::vector<ResolvedRobotUse> getUsedRobotStates() const;
  /// Gains by name.
  std::map<std::string, std::vector<double>> getGains() const;
  /// The developer's additional information.
  std::string getInformation() const { return describe().information; }
  /// describe() together with what addUsed...State() declared.
  Description declaration() const;
  /// @}

  /// @name Control methods (Table I), outside the cycle
  /// With a manager they do what the manager's methods of the same name do; without one they act
  /// on the instance.
  /// @{
  Status enable();         ///< starts contributing
  Status disable();        ///< stops contributing; identity on the control states
  Status pause();          ///< stops running; the last correction follows its policy
  Status resume();         ///< withdraws the pause of the user
  bool isEnabled() const;  ///< true if enabled
  bool isPaused() const;   ///< true if paused for any reason
  /// Reads gains from a file; all or nothing. Errors name file, line and field.
  Status loadGains(const std::string& file);
  /// Sets gains by name; all or nothing.
  Status setGains(const std::map<std::string, std::vector<double>>& gains);
  /// @}

 protected:
  /// Present value of a gain, in the cycle.
  Eigen::Map<const Eigen::VectorXd> gain(Gain handle) const { return gains_[handle]; }
  /// Present value of a scalar gain, in the cycle.
  double scalar(Gain handle) const { return gains_.scalar(handle); }
  /// Reports a fault from update() without the cost of an exception.
  /// @param reason literal text; must stay valid
  void fail(const char* reason) { failure_ = reason; }
  /// Log source of this controller: records carry its name and the cycle.
  const LogSource& log() const { return log_; }

 private:
  friend class ControllerSlot;

  GainValues presentGains() const;

  const char* failure_ = nullptr;
  std::string name_;
  GainValues gains_;
  LogSource log_;
  ControllerOwner* owner_ = nullptr;
  bool alone_enabled_ = false;
  bool alone_paused_ = false;
  bool initialized_ = false;
  std::vector<RobotSignalUse> added_robot_;
  std::vector<ControlSignalUse> added_control_;
  std::vector<ResolvedRobotUse> robot_uses_;
  std::vector<ResolvedControlUse> control_uses_;
};

}  // namespace ctrl_more
