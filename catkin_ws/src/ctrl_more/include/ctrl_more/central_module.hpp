#pragma once

#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "ctrl_more/description/config_node.hpp"
#include "ctrl_more/feedback_controllers_manager.hpp"
#include "ctrl_more/loading/plugin_library.hpp"
#include "ctrl_more/log/logger.hpp"
#include "ctrl_more/manager/manager.hpp"
#include "ctrl_more/states/control_states.hpp"
#include "ctrl_more/states/robot_states.hpp"

namespace ctrl_more {

/// Makes a manager of a library from its block in the central module's file. May throw.
using ManagerLibraryMaker = std::unique_ptr<Manager> (*)(const std::string& name,
                                                         const ConfigNode& block,
                                                         RobotStates& robot, ControlStates& control,
                                                         Logger* logger);

/// The types of managers that libraries have registered.
class ManagerPrototypes : public PluginTypesOf<ManagerLibraryMaker> {
 public:
  /// No types.
  ManagerPrototypes();
  /// Registers a maker; false if the type is known or the ABI differs, which the loader reports.
  bool insert(const std::string& type, ManagerLibraryMaker maker, const Abi& abi = thisAbi());
  /// Does nothing: a manager is made from its block of a file.
  void tryOne(const std::string&) const override {}
};

/// The types, one list per process.
ManagerPrototypes& managerPrototypes();

/// Registers a type of managers while its library is loaded. Used by the macro below.
class ManagerRegistration {
 public:
  /// Inserts the type.
  ManagerRegistration(const char* type, ManagerLibraryMaker maker, const Abi& abi = thisAbi())
      : type_(type), maker_(maker) {
    managerPrototypes().insert(type_, maker_, abi);
  }
  /// Erases the type.
  ~ManagerRegistration() { managerPrototypes().erase(type_, maker_); }
  ManagerRegistration(const ManagerRegistration&) = delete;
  ManagerRegistration& operator=(const ManagerRegistration&) = delete;

 private:
  std::string type_;
  ManagerLibraryMaker maker_;
};

/// Runs the managers of a robot in the order that the user chose. All managers share one
/// RobotStates and one ControlStates (Ctrl-MORE paper, section VI).
///
/// Its file lists the managers, and for each its type and parameters:
///
///     managers: [locomotion, feedback]
///     joints: 7                 # of the control states
///     period: 0.005             # [s]
///     signals: signals.yaml     # optional; the host reads it
///     locomotion: {type: MyLocomotion, step_length: 0.2}
///     feedback: {type: Feedback, listFile: feedback.yaml}
///
/// A type of a library may have `libPath`; without it, its library is found by the name of the type
/// (SearchPath::findLibraryOf()). See CTRL_MORE_REGISTER_MANAGER.
///
/// Each stage runs in all managers, in order, before the next stage begins. If a manager other than
/// Feedback writes a number that is not finite, its writes are undone, and it is off from then on.
class CentralModule {
 public:
  /// Makes a manager from its block of the file. May throw ConfigError.
  using ManagerMaker = std::function<std::unique_ptr<Manager>(
      const std::string& name, const ConfigNode& block, RobotStates& robot, ControlStates& control,
      Logger* logger)>;

  /// Registers a type of manager for all central modules of the program. `Feedback` is registered
  /// from the start.
  /// @param type name in the file
  /// @param maker makes a manager of this type
  /// @return false if the type is already registered
  static bool registerManager(const std::string& type, ManagerMaker maker);

  /// Builds all managers of a file.
  /// @param file path
  /// @param logger null: Logger::standard()
  /// @throws ConfigError with file, line and field. A feedback controller that cannot be loaded
  ///         does not throw: the logger and loadErrors() report it
  explicit CentralModule(const std::string& file, Logger* logger = nullptr);

  /// As above, from a parsed file or text.
  CentralModule(const ConfigNode& config, const std::string& base, Logger* logger = nullptr);

  /// A robot that owns the stores and starts the stages itself.
  struct Host {
    RobotStates& robot;                ///< must outlive the module
    ControlStates& control;            ///< must outlive the module
    ManagerOptions feedback;           ///< of the Feedback manager, unless given in the file
    std::vector<std::string> folders;  ///< searched for libraries of managers
  };

  /// As above, on a robot. `joints` and `period` may be omitted. Values that differ from the
  /// robot's are refused, and so is a file without a Feedback manager.
  CentralModule(const ConfigNode& config, const std::string& base, const Host& host,
                Logger* logger = nullptr);
  ~CentralModule();
  CentralModule(CentralModule&&) noexcept;

  /// The shared robot states. The user fills them before update().
  RobotStates& robotStates() { return *robot_; }
  /// The shared control states. The user reads them after update().
  ControlStates& controlStates() { return *control_; }
  /// List file of the feedback manager, as written in the file; empty: none.
  const std::string& feedbackList() const { return feedback_list_; }
  /// The feedback manager; throws std::logic_error if the file lists none.
  FeedbackControllersManager& feedbackControllers();
  /// A manager by name; throws std::invalid_argument with the nearest known one.
  Manager& manager(const std::string& name);
  /// Names of the managers in their order.
  std::vector<std::string> managers() const;
  /// Errors of loading, one sentence each.
  const std::vector<std::string>& loadErrors() const { return load_errors_; }

  /// One cycle of all managers. No allocation after the first, no lock.
  /// @param cycle time
  void update(const Cycle& cycle) noexcept;

  /// @name The parts of update(), for a host
  /// @{

  /// Begins a cycle.
  void begin(const Cycle& cycle) noexcept;
  /// Runs a stage.
  void run(Stage stage) noexcept;
  /// Ends the cycle.
  void end() noexcept;
  /// @}

  /// One cycle for users without a clock. The time is the newest stamp of the robot states.
  void update() noexcept;

  /// update() as in the paper, with the user's own states. Not real-time safe: it adds keys that
  /// the shared states lack.
  /// @param robot all of its signals are copied into the shared robot states
  /// @param control input: references; output: modified references
  /// @return failure if a signal does not fit the shared states
  Status update(const RobotStates& robot, ControlStates* control);

  /// Prints managers, states and controllers.
  void plot(std::ostream& out) const;

 private:
  void build(const ConfigNode& config, const std::string& base);
  void makeStores(const ConfigNode& config);
  std::unique_ptr<Manager> makeFeedback(const std::string& name, const ConfigNode& block,
                                        const std::string& base);
  std::unique_ptr<Manager> makeOther(const std::string& name, const ConfigNode& block,
                                     const ConfigNode& type, const std::string& base);
  std::unique_ptr<Manager> makeFromLibrary(const std::string& name, const ConfigNode& block,
                                           const std::string& type, const std::string& path);
  void isolate(std::size_t manager, Stage stage) noexcept;

  struct Own;  // stores without a host

  Logger* logger_;
  std::unique_ptr<Own> own_;
  RobotStates* robot_ = nullptr;
  ControlStates* control_ = nullptr;
  ManagerOptions options_;
  std::vector<std::string> folders_;
  std::vector<std::shared_ptr<PluginLibrary>>
      libraries_;  // before the managers, whose code they are
  std::vector<std::unique_ptr<Manager>> managers_;
  std::vector<LogSource> logs_;  // of each manager
  std::vector<bool> off_;        // managers that wrote numbers that are not finite
  std::vector<double> before_;   // references before a manager
  FeedbackControllersManager* feedback_ = nullptr;
  std::string feedback_list_;
  std::vector<std::string> load_errors_;
  std::uint64_t number_ = 0;
};

}  // namespace ctrl_more

/// Registers a class of managers from the source file of its library:
/// `CTRL_MORE_REGISTER_MANAGER(my_lab::Walk, "Walk")`. Its constructor takes the arguments of
/// ManagerLibraryMaker. Use it once per library, outside of any namespace.
#define CTRL_MORE_REGISTER_MANAGER(Class, type)                                                    \
  namespace {                                                                                      \
  std::unique_ptr<::ctrl_more::Manager> ctrlMoreManagerMaker(const std::string& name,              \
                                                             const ::ctrl_more::ConfigNode& block, \
                                                             ::ctrl_more::RobotStates& robot,      \
                                                             ::ctrl_more::ControlStates& control,  \
                                                             ::ctrl_more::Logger* logger) {        \
    return std::make_unique<Class>(name, block, robot, control, logger);                           \
  }                                                                                                \
  const ::ctrl_more::ManagerRegistration ctrl_more_manager_registration(type,                      \
                                                                        &ctrlMoreManagerMaker);    \
  }
