#pragma once

/// @file
/// Base class of feedback controllers, and their registration.

#include <atomic>
#include <map>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "ctrl_more/description/change.hpp"
#include "ctrl_more/description/configuration.hpp"
#include "ctrl_more/description/description.hpp"
#include "ctrl_more/description/setup.hpp"
#include "ctrl_more/loading/plugin_types.hpp"
#include "ctrl_more/log/logger.hpp"
#include "ctrl_more/states/control_states.hpp"
#include "ctrl_more/states/cycle.hpp"
#include "ctrl_more/states/handles.hpp"
#include "ctrl_more/states/modified_control_states.hpp"
#include "ctrl_more/states/robot_states.hpp"
#include "ctrl_more/states/so3.hpp"
#include "ctrl_more/states/status.hpp"

namespace ctrl_more {

/// Interface of the manager to its controllers. The control methods of Table I use it.
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

/// Base class of a feedback controller, which reads robot states and modifies references.
///
/// A developer overrides describe(), initialize() and update(). The other methods of the first
/// group are optional. CTRL_MORE_REGISTER_CONTROLLER (or the paper's own maker, see
/// FeedbackControllerPrototypes) registers the class, which is compiled into a separate library.
/// The class has all methods of Table I of the Ctrl-MORE paper. Its documentation and control
/// methods are already implemented; they use the description.
///
/// Threads: update(), state(), reset() and gainsChanged() run in the control cycle: no allocation,
/// no lock, no system call. All other methods run outside the cycle.
class FeedbackController {
 public:
  FeedbackController() = default;
  FeedbackController(const FeedbackController&) = delete;
  FeedbackController& operator=(const FeedbackController&) = delete;
  virtual ~FeedbackController() = default;

  /// @name Methods that the developer overrides
  /// @{

  /// Declaration of the controller, see Description. It must not depend on the instance.
  virtual Description describe() const = 0;

  /// Fetches handles and configuration. Called once, outside the cycle. May allocate and throw. If
  /// it throws, the controller is refused with the text of the exception.
  /// @param setup returns handles of the signals and gains that describe() declares
  virtual void initialize(Setup& setup) = 0;

  /// Runs the controller once. May throw or call fail(). The manager then undoes its writes,
  /// releases its last correction by its policy, and pauses it with the reason.
  /// @param cycle time
  /// @param robot robot states of this cycle
  /// @param original references at the start of the stage, before any feedback controller
  /// @param modified references after the controllers before this one
  virtual void update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
                      ModifiedControlStates& modified) = 0;

  /// Clears internal state (integrators, filters, previous values). Called in the cycle before the
  /// first update() after enabling or a fault, and, with SwitchPolicy::Reset, when the motion
  /// controller changes.
  virtual void reset() {}

  /// Called in the cycle after gain values changed, before the next update().
  virtual void gainsChanged() {}

  /// Checks a combination of gains before it is accepted, outside the cycle. The range of each
  /// single gain is already checked.
  /// @return "" if the gains are valid, else one sentence
  virtual std::string judgeGains(const GainValues& gains) const {
    static_cast<void>(gains);
    return "";
  }

  /// Writes the numbers that the description declares with Description::state(), in that order.
  /// Called in the cycle after each update(), if any is declared. CycleRecord contains them.
  /// @param values one element per declared state
  virtual void state(Numbers<> values) const { static_cast<void>(values); }
  /// @}

  /// @name Documentation methods (Table I)
  /// @{

  /// Sets the name of the instance. Refused if a manager has loaded the controller: the name then
  /// comes from the list file.
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
  /// True if the robot signal is declared. `name` is `key` or `measuredData/key`.
  bool isUsingRobotState(const std::string& name) const;
  /// True if the control signal is declared. `name` is `key` or `container/key`.
  bool isUsingControlState(const std::string& name) const;
  /// Declared control signals with key, size, unit and access.
  std::vector<ResolvedControlUse> getUsedControlState() const;
  /// Same as getUsedControlState().
  std::vector<ResolvedControlUse> getUsedControlStates() const { return getUsedControlState(); }
  /// Declared robot signals with key, size, unit and age.
  std::vector<ResolvedRobotUse> getUsedRobotStates() const;
  /// Gains by name.
  std::map<std::string, std::vector<double>> getGains() const;
  /// The developer's additional information.
  std::string getInformation() const { return describe().information; }
  /// describe() plus the signals that addUsed...State() declared.
  Description declaration() const;
  /// @}

  /// @name Control methods (Table I), outside the cycle
  /// With a manager they call the manager's methods of the same name. Without one they act on the
  /// instance.
  /// @{
  Status enable();         ///< starts contributing
  Status disable();        ///< stops contributing; the control states pass unchanged
  Status pause();          ///< stops running; the policy decides about the last correction
  Status resume();         ///< ends the pause with the reason "user"
  bool isEnabled() const;  ///< true if enabled
  bool isPaused() const;   ///< true if paused for any reason
  /// Reads gains from a file; all or nothing. Errors name file, line and field.
  Status loadGains(const std::string& file);
  /// Sets gains by name; all or nothing.
  Status setGains(const std::map<std::string, std::vector<double>>& gains);
  /// @}

 protected:
  /// Current value of a gain, in the cycle.
  Eigen::Map<const Eigen::VectorXd> gain(Gain handle) const { return gains_[handle]; }
  /// Current value of a scalar gain, in the cycle.
  double scalar(Gain handle) const { return gains_.scalar(handle); }
  /// Reports a fault from update() without the cost of an exception.
  /// @param reason string literal; must stay valid
  void fail(const char* reason) { failure_ = reason; }
  /// Log source of this controller. Its records contain the controller's name and the cycle.
  const LogSource& log() const { return log_; }

 private:
  friend class Slot;

  GainValues presentGains() const;

  const char* failure_ = nullptr;
  std::string name_;
  GainValues gains_;
  LogSource log_;
  std::atomic<ControllerOwner*> owner_{nullptr};  // other threads may query during loading
  bool alone_enabled_ = false;
  bool alone_paused_ = false;
  bool initialized_ = false;
  std::vector<RobotSignalUse> added_robot_;
  std::vector<ControlSignalUse> added_control_;
  std::vector<ResolvedRobotUse> robot_uses_;
  std::vector<ResolvedControlUse> control_uses_;
};

/// ABI of the file that is being compiled, for libraries of feedback controllers. Increase the
/// interface number when classes or meanings change. Static, so that each library has its own copy.
static inline constexpr Abi thisAbi() {
  return abiOf<FeedbackController, RobotStates, ControlStates, ModifiedControlStates, Description,
               RobotSignalUse, ControlSignalUse, GainSpec, SettingSpec, StateSpec, Setup, Numbers<>,
               Cycle>(6);
}

/// Makes a controller, which the caller owns. The paper's type for its prototypes.
using FeedbackControllerMaker = FeedbackController* (*)();

/// The shared map of controller types (Ctrl-MORE paper, section V-B). Every plug-in library inserts
/// its makers when it is loaded. The map also stores refused insertions, so that the loader can
/// report a library that registers a known name.
class FeedbackControllerPrototypes : public PluginTypesOf<FeedbackControllerMaker> {
 public:
  /// No types.
  FeedbackControllerPrototypes();

  /// Registers a maker under a type name, as the paper's listing does:
  /// `feedbackControllerPrototypes.insert({"MyController", feedbackExampleMaker});`
  /// @param entry type name and maker
  /// @param abi ABI of the caller; use the default
  /// @return false if the name is already registered or the ABI differs; the loader then reports it
  bool insert(const std::pair<const std::string, FeedbackControllerMaker>& entry,
              const Abi& abi = thisAbi());

  /// Makes a controller, calls describe() and destroys it.
  void tryOne(const std::string& type) const override;
};

/// The map, one per process. A function, so that the map exists before the static objects of any
/// library.
FeedbackControllerPrototypes& prototypes();

/// The map under the name in the paper's listing.
[[maybe_unused]] static FeedbackControllerPrototypes& feedbackControllerPrototypes = prototypes();

/// Registers a type while the library is loaded. Used by the macro below.
class PrototypeRegistration {
 public:
  /// Inserts the type.
  PrototypeRegistration(const char* type, FeedbackControllerMaker maker, const Abi& abi = thisAbi())
      : type_(type), maker_(maker) {
    prototypes().insert({type_, maker_}, abi);
  }
  /// Erases the type.
  ~PrototypeRegistration() { prototypes().erase(type_, maker_); }
  PrototypeRegistration(const PrototypeRegistration&) = delete;
  PrototypeRegistration& operator=(const PrototypeRegistration&) = delete;

 private:
  std::string type_;
  FeedbackControllerMaker maker_;
};

}  // namespace ctrl_more

/// Registers a controller class from its source file:
/// `CTRL_MORE_REGISTER_CONTROLLER(my_lab::WristDamper, "WristDamper")`. The name must equal
/// describe().type. Use it once per library, outside of any namespace.
#define CTRL_MORE_REGISTER_CONTROLLER(Class, type)                                       \
  namespace {                                                                            \
  ::ctrl_more::FeedbackController* ctrlMoreMaker() { return new Class(); }               \
  const ::ctrl_more::PrototypeRegistration ctrl_more_registration(type, &ctrlMoreMaker); \
  }
