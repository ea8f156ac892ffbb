#pragma once

/// @file
/// For the author of a controller: the base class and its registration.

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
/// A developer writes a class with describe(), initialize() and update(), the other methods of the
/// first group only where they are needed, registers it with CTRL_MORE_REGISTER_CONTROLLER (or with
/// the paper's own maker, see FeedbackControllerPrototypes), and compiles it into a library of its
/// own. Everything of Table I of the Ctrl-MORE paper is here; what only documents or administrates
/// is implemented once, from the description.
///
/// Threads: update(), state(), reset() and gainsChanged() run in the control cycle: no allocation,
/// no lock, no system call. Everything else runs outside of it.
class FeedbackController {
 public:
  FeedbackController() = default;
  FeedbackController(const FeedbackController&) = delete;
  FeedbackController& operator=(const FeedbackController&) = delete;
  virtual ~FeedbackController() = default;

  /// @name What the developer writes
  /// @{

  /// The one declaration of the controller; see Description. Must not depend on the instance.
  virtual Description describe() const = 0;

  /// Fetches handles and configuration; called once, outside the cycle. May allocate and throw:
  /// an exception refuses the controller with its text.
  /// @param setup gives handles for what describe() declares
  virtual void initialize(Setup& setup) = 0;

  /// Runs the controller once. May throw or call fail(): its writes are then
  /// undone, its last correction is let go by policy, and it is paused with the reason.
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
  friend class Slot;

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

/// The numbers of the file that is being compiled, for libraries of feedback controllers. The first
/// one is raised when classes or meanings change. Static, so that a library keeps its own.
static inline constexpr Abi thisAbi() {
  return abiOf<FeedbackController, RobotStates, ControlStates, ModifiedControlStates, Description,
               RobotSignalUse, ControlSignalUse, GainSpec, SettingSpec, StateSpec, Setup, Numbers<>,
               Cycle>(5);
}

/// Makes one controller; the caller owns it. The paper's type for its prototypes.
using FeedbackControllerMaker = FeedbackController* (*)();

/// The shared map of controller types (Ctrl-MORE paper, section V-B): every plug-in library puts
/// its makers in when it is loaded. Unlike a plain map it remembers refused insertions, so that a
/// library which registers a known name is told so.
class FeedbackControllerPrototypes : public PluginTypesOf<FeedbackControllerMaker> {
 public:
  /// No types.
  FeedbackControllerPrototypes();

  /// Registers a maker under a type name, as the paper's listing does:
  /// `feedbackControllerPrototypes.insert({"MyController", feedbackExampleMaker});`
  /// @param entry type name and maker
  /// @param abi what the caller was compiled with; leave it out
  /// @return false, and a note for the loader, if the name is known already or the ABI is another
  ///         one
  bool insert(const std::pair<const std::string, FeedbackControllerMaker>& entry,
              const Abi& abi = thisAbi());
};

/// The map itself, one per process. A function, so that it exists before any library's static
/// objects run.
FeedbackControllerPrototypes& prototypes();

/// The same under the name that the paper's listing uses.
[[maybe_unused]] static FeedbackControllerPrototypes& feedbackControllerPrototypes = prototypes();

/// Registers for as long as the library is loaded. Used by the macro below.
class PrototypeRegistration {
 public:
  /// Inserts.
  PrototypeRegistration(const char* type, FeedbackControllerMaker maker, const Abi& abi = thisAbi())
      : type_(type), maker_(maker) {
    prototypes().insert({type_, maker_}, abi);
  }
  /// Erases.
  ~PrototypeRegistration() { prototypes().erase(type_, maker_); }
  PrototypeRegistration(const PrototypeRegistration&) = delete;
  PrototypeRegistration& operator=(const PrototypeRegistration&) = delete;

 private:
  std::string type_;
  FeedbackControllerMaker maker_;
};

}  // namespace ctrl_more

/// Registers a controller class from its source file:
/// `CTRL_MORE_REGISTER_CONTROLLER(my_lab::WristDamper, "WristDamper")`. The name must be the one
/// in describe().type. Use it once per library, outside of any namespace.
#define CTRL_MORE_REGISTER_CONTROLLER(Class, type)                                       \
  namespace {                                                                            \
  ::ctrl_more::FeedbackController* ctrlMoreMaker() { return new Class(); }               \
  const ::ctrl_more::PrototypeRegistration ctrl_more_registration(type, &ctrlMoreMaker); \
  }
