#pragma once

#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "ctrl_more/description/config_node.hpp"
#include "ctrl_more/feedback_controllers_manager.hpp"
#include "ctrl_more/log/logger.hpp"
#include "ctrl_more/manager/manager.hpp"
#include "ctrl_more/states/control_states.hpp"
#include "ctrl_more/states/robot_states.hpp"

namespace ctrl_more {

/// The managers of a robot in the order the user chose, over one pair of shared states
/// (Ctrl-MORE paper, section VI).
///
/// Its file lists the managers and says for each what it is and which members it has:
///
///     managers: [locomotion, feedback]
///     joints: 7                 # of the control states
///     period: 0.005             # [s]
///     locomotion: {type: MyLocomotion, step_length: 0.2}
///     feedback: {type: Feedback, listFile: feedback.yaml}
///
/// All managers are updated at once: in each stage every manager in turn, the first stage of all
/// before the second stage of any.
class CentralModule {
 public:
  /// Makes a manager from its block of the file. May throw ConfigError.
  using ManagerMaker = std::function<std::unique_ptr<Manager>(
      const std::string& name, const ConfigNode& block, RobotStates& robot, ControlStates& control,
      Logger* logger)>;

  /// Makes a type of manager known to all central modules of the program. `Feedback` is known
  /// from the start.
  /// @param type name for the file
  /// @param maker makes one
  /// @return false if the type is known already
  static bool registerManager(const std::string& type, ManagerMaker maker);

  /// Builds all managers of a file.
  /// @param file path
  /// @param logger null: Logger::standard()
  /// @throws ConfigError naming file, line and field; controllers of a feedback manager that
  ///         could not be loaded are reported on the logger and in loadErrors() instead
  explicit CentralModule(const std::string& file, Logger* logger = nullptr);

  /// As above, from a parsed file or text.
  CentralModule(const ConfigNode& config, const std::string& base, Logger* logger = nullptr);

  /// The shared robot states: the user fills them before update().
  RobotStates& robotStates() { return *robot_; }
  /// The shared control states: the user reads them after update().
  ControlStates& controlStates() { return *control_; }
  /// The feedback manager; throws std::logic_error if the file lists none.
  FeedbackControllersManager& feedbackControllers();
  /// A manager by name; throws std::invalid_argument with the nearest known one.
  Manager& manager(const std::string& name);
  /// Names of the managers in their order.
  std::vector<std::string> managers() const;
  /// What could not be loaded, one sentence each.
  const std::vector<std::string>& loadErrors() const { return load_errors_; }

  /// One cycle of all managers. No allocation, no lock.
  /// @param cycle time
  void update(const Cycle& cycle) noexcept;

  /// One cycle for users without a clock: now is the newest stamp of the robot states.
  void update() noexcept;

  /// The paper's form: the user's own states go in, and the modified references come out.
  /// Outside the real-time path: keys that the shared states lack are added.
  /// @param robot all of its signals are copied into the shared robot states
  /// @param control its references go in, the modified ones come out
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
                                     const ConfigNode& type);

  Logger* logger_;
  std::unique_ptr<RobotStates> robot_;
  std::unique_ptr<ControlStates> control_;
  std::vector<std::unique_ptr<Manager>> managers_;
  FeedbackControllersManager* feedback_ = nullptr;
  std::vector<std::string> load_errors_;
  std::uint64_t number_ = 0;
};

}  // namespace ctrl_more
