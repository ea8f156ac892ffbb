#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "ctrl_more/control_states.hpp"
#include "ctrl_more/cycle.hpp"
#include "ctrl_more/description.hpp"
#include "ctrl_more/gains.hpp"
#include "ctrl_more/handles.hpp"
#include "ctrl_more/logger.hpp"
#include "ctrl_more/modified_control_states.hpp"
#include "ctrl_more/robot_states.hpp"
#include "ctrl_more/setup.hpp"
#include "ctrl_more/status.hpp"

namespace ctrl_more {

class FeedbackController;

/// What Table I's control methods of a controller need from whoever manages it.
class ControllerOwner {
 public:
  virtual ~ControllerOwner() = default;
  /// Enables or disables one controller by name.
  virtual Status setEnabled(const std::string& name, bool enabled) = 0;
  /// Pauses or resumes one controller by name, with the reason "user".
  virtual Status setPaused(const std::string& name, bool paused) = 0;
  /// Replaces gains of one controller while it may be running.
  virtual Status replaceGains(const std::string& name, const GainValues& gains) = 0;
  /// True if enabled.
  virtual bool enabled(const std::string& name) const = 0;
  /// True if paused for any reason, faults included.
  virtual bool paused(const std::string& name) const = 0;
  /// The gains as the manager has them.
  virtual GainValues gainsOf(const std::string& name) const = 0;
};

/// A feedback controller: reads the robot's state and modifies references in the control cycle.
///
/// A developer writes a class with describe(), initialize() and update(), registers it with
/// CTRL_MORE_REGISTER_CONTROLLER (or with the paper's own maker, see prototypes.hpp), and compiles
/// it into a library of its own. Everything of Table I of the Ctrl-MORE paper is here; what only
/// documents or administrates is implemented once, from the description.
///
/// Threads: update(), state(), reset() and gainsChanged() run in the control cycle: no allocation, no lock,
/// no system call. Everything else runs outside of it.
class FeedbackController {
 public:
  FeedbackController() = default;
  virtual ~FeedbackController() = default;
  FeedbackController(const FeedbackController&) = delete;
  FeedbackController& operator=(const FeedbackController&) = delete;

  /// @name What a developer writes
  /// @{

  /// The one declaration of the controller; see Description. Must not depend on the instance.
  virtual Description describe() const = 0;

  /// Fetches handles and configuration; called once, outside the cycle. May allocate and throw:
  /// an exception refuses the controller with its text.
  /// @param setup gives handles for what describe() declares
  virtual void initialize(Setup& setup) = 0;

  /// Runs the controller once. May throw or call fail(): its writes are then undone, its last
  /// correction is let go by policy, and it is paused with the reason.
  /// @param cycle time
  /// @param robot robot states of this cycle
  /// @param original references at the start of the stage, before any feedback controller
  /// @param modified references as the controllers before this one left them
  virtual void update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
                      ModifiedControlStates& modified) = 0;

  /// Forgets internal state (integrators, filters, previous values). Called in the cycle before
  /// the first update() after enabling, after a fault, and at a switch of motion if the
  /// description says so.
  virtual void reset() {}

  /// Called in the cycle after gain values changed, before the next update().
  virtual void gainsChanged() {}

  /// Judges gains together (each alone is judged by its range), outside the cycle, before they are
  /// accepted.
  /// @return "" if they fit, else one sentence
  virtual std::string judgeGains(const GainValues& gains) const {
    static_cast<void>(gains);
    return "";
  }

  /// Writes the numbers that the description declares with Description::state(), in that order.
  /// Called in the cycle after each update(), if any is declared; the manager shows them.
  /// @param values as many as are declared
  virtual void state(Numbers<> values) const { static_cast<void>(values); }
  /// @}

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
  Status enable();                 ///< starts contributing
  Status disable();                ///< stops contributing; identity on the control states
  Status pause();                  ///< stops running; the last correction follows its policy
  Status resume();                 ///< withdraws the pause of the user
  bool isEnabled() const;          ///< true if enabled
  bool isPaused() const;           ///< true if paused for any reason
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

  const char* failure_ = nullptr;  // first: read each cycle
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
