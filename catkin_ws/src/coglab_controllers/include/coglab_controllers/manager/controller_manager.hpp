/// @file
/// The controller manager without ROS (D4.10, Table 6). It loads, lists and switches controllers
/// and owns the control cycle.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "coglab_controllers/manager/control_cycle.hpp"
#include "coglab_controllers/manager/plugin_registry.hpp"
#include "ctrl_more/loading/plugin_library.hpp"

namespace coglab_controllers {

/// Settings of a controller manager. All but the robot have defaults.
struct ManagerSettings {
  std::shared_ptr<const RobotSetup> robot;
  CycleSettings cycle;
  /// Parameters of the plug-ins, by id, and of the manager (see readManagerSettings()).
  YAML::Node parameters;
  /// Type name to library, for example coglab/DmpController: libcoglab_dmp_controller.so.
  std::map<std::string, std::string> types;
  std::vector<std::string> plugin_paths;  ///< folders searched for libraries without a path
  std::string feedback_file;  ///< list file of Ctrl-MORE; empty: no feedback controllers
  std::string central_file;   ///< Ctrl-MORE's central module; empty: feedback controllers alone
  std::string signals_file;   ///< see signal_file.hpp; empty: no signals from topics
  TopicRules topics;          ///< for the topics of that file
  double plan_timeout = 2.0;  ///< s, longest wait of a request for the cycle
  bool lockstep = false;      ///< the caller's thread adopts requests; no time limits
  std::function<std::int64_t()>
      clock;  ///< clock of the samples' stamps, ns; empty: the steady clock
  ctrl_more::Logger* logger = nullptr;  ///< for feedback controllers; null: Logger::standard()
};

/// Reads the manager's own parameters: `cycle_time` (0.005 s), `sample_timeout`, `silent_time`,
/// `overrun_time` (s), `plan_timeout` (s), `speed_scale`, `types` (block: type -> library; the two
/// of this package are built in), `plugin_paths`, `feedback_file`, `central_file`, `signals_file`,
/// and those of makeRobotSetup().
/// @throws std::runtime_error naming the parameter
ManagerSettings readManagerSettings(const YAML::Node& parameters, const std::string& urdf,
                                    const coglab_rt::JointLimits& table, bool lockstep);

/// A loaded motion controller.
struct LoadedMotion {
  std::string id, type;
  std::shared_ptr<ctrl_more::PluginLibrary> library;  ///< null for types linked into the program
  std::unique_ptr<MotionController> controller;
  std::shared_ptr<MotionCancel> cancel = std::make_shared<MotionCancel>();
};

/// Loads controllers and selects the active one. Services call it from any thread; requests run one
/// after another. The control thread uses only cycle().
class ControllerManager : public MotionHost {
 public:
  explicit ControllerManager(ManagerSettings settings);
  ~ControllerManager() override;
  ControllerManager(const ControllerManager&) = delete;
  ControllerManager& operator=(const ControllerManager&) = delete;

  /// @name Requests of Table 6
  /// @{

  /// Callback that prepares a controller before it can be used, for example advertises its
  /// services. If it throws, the controller is not loaded.
  using Attach = std::function<void(MotionController&, const MotionMaker&)>;

  /// Loads a controller of a type under an id: a motion controller, or a feedback controller if the
  /// type belongs to Ctrl-MORE. If the plug-in throws, nothing stays loaded.
  Answer load(const std::string& id, const std::string& type, const Attach& attach = {});
  /// Loads a motion controller that the caller has made, under a name of its type that no library
  /// has. If configure() throws, it is not loaded.
  Answer load(const std::string& id, const std::string& type,
              std::unique_ptr<MotionController> controller);
  /// Reserves an id for a controller that is being loaded, as long as the result exists. Null if
  /// the id is in use.
  std::shared_ptr<void> claim(const std::string& id);
  /// Callback that ends the services of a controller during unloading. It keeps the pointer as long
  /// as it needs the controller.
  using Detach = std::function<void(std::shared_ptr<const LoadedMotion>)>;

  /// Unloads a motion or feedback controller. The active motion controller is refused.
  Answer unload(const std::string& id, const Detach& detach = {});
  /// Ids and types of all loaded controllers, in load order; feedback controllers after motion
  /// controllers.
  void list(std::vector<std::string>& ids, std::vector<std::string>& types) const;
  /// Activates a motion controller and applies the feedback profile of the same name. A controller
  /// that is already active continues, unless it is at fault: then it restarts. With an empty id,
  /// no controller is active: the motion ends, and feedback controllers stay as they are.
  Answer switchTo(const std::string& id, std::string& type);
  /// Id and type of the active controller; empty if there is none.
  void active(std::string& id, std::string& type) const;
  /// Enables exactly the feedback controllers of a profile, for example dmp_compliant during an
  /// approach.
  Answer applyProfile(const std::string& profile);
  /// Sets the clock rate of all motions, 0 (standstill) to 1.
  Answer setSpeedScale(double scale);
  /// @}

  /// @name Cancel: ends the running motion of a controller and its queue
  /// @{

  /// Ends the motion and waits until the arm stands. It does not wait for other requests. Not in
  /// lockstep.
  /// @param time_limit longest wait, s, at most 10; 0 or less: 2
  /// @param why caller and reason, for the log; may be empty
  CancelAnswer cancel(const std::string& id, double time_limit, const std::string& why);
  /// The same without waiting. The next cycle ends the motion; earlier requests become invalid.
  CancelOrder askCancel(const std::string& id, const std::string& why);
  /// True if a cancel is complete: the arm stands, or there was no motion.
  bool cancelEnded(const CancelOrder& order, CancelAnswer& answer) const;
  /// Answer to a cancel that is not complete after `waited` s.
  CancelAnswer cancelUnfinished(const CancelOrder& order, double waited) const;
  /// Ends every wait of cancel() at once, because the program ends.
  void endWaits() { ending_.store(true, std::memory_order_relaxed); }
  /// @}

  /// A loaded motion controller; null if the id is unknown. Valid until it is unloaded.
  MotionController* motion(const std::string& id);

  ctrl_more::FeedbackControllersManager& feedback() { return feedback_.manager(); }
  /// The stores of the feedback controllers and the signals from topics.
  FeedbackStage& feedbackStage() { return feedback_; }
  /// The topics that the file of signals makes of feedback controllers.
  const std::vector<SignalOutput>& signalOutputs() const { return outputs_; }
  /// Errors from loading the files of signals, managers and feedback controllers, one sentence
  /// each.
  const std::vector<std::string>& feedbackErrors() const { return feedback_errors_; }
  ControlCycle& cycle() { return cycle_; }
  const ManagerSettings& settings() const { return settings_; }
  /// The newest report of the cycle; any thread.
  CycleReport report() const;
  /// Name of the feedback profile applied last.
  std::string profile() const;

  /// Lock for requests that make a plan; hold it while building the plan.
  std::unique_lock<std::mutex> lockRequests() { return std::unique_lock<std::mutex>(requests_); }
  /// Accepts a new motion of this controller by this report, or returns what to do first.
  Answer motionWelcome(const std::string& controller_id, const CycleReport& now) const;

  // MotionHost
  std::int64_t now_ns() const override;
  double planTimeout() const override { return settings_.plan_timeout; }

 private:
  // The rest of MotionHost is private, because plug-ins use the manager only by that interface.
  MotionRequest beginRequest(const std::string& controller_id) override;
  RobotSample robotSnapshot() const override { return report().robot; }
  std::function<void()> cycleWait() const override;
  /// Message for a plan that the cycle did not adopt, with the controller whose code is running.
  std::string notAdopted(PlanOutcome outcome) const override;

  /// Refuses an id that is not valid or in use, else reserves it.
  Answer claimNew(const std::string& id, std::shared_ptr<void>& claimed);
  /// Configures a controller and puts it into the table. @throws what configure() or `attach`
  /// throws
  void add(std::shared_ptr<LoadedMotion> loaded,
           const std::function<void(MotionController&)>& attach);
  Answer loadMotion(const std::string& id, const std::string& type, const Attach& attach);
  Answer loadFeedback(const std::string& id, const std::string& type);
  void loadSignals();
  void loadManagers();
  void checkOutputs(std::size_t own_rows);
  void checkOutput(const SignalOutput& row);
  std::string libraryOf(const std::string& type) const;
  Answer planSwitch(const std::string& id, CyclePlan& plan, std::string& type);
  LoadedMotion* find(const std::string& id) const;  // under table_
  std::string loadedMotions() const;

  ManagerSettings settings_;
  FeedbackStage feedback_;
  ControlCycle cycle_;
  std::vector<std::string> feedback_errors_;
  std::vector<SignalOutput> outputs_;

  std::atomic<bool> ending_{false};
  mutable std::mutex requests_;  // requests one after another
  mutable std::mutex table_;     // the members below; held briefly
  std::vector<std::shared_ptr<LoadedMotion>> motions_;
  std::set<std::string> loading_;  // ids of controllers that are being loaded
  std::string active_id_, active_type_, profile_;
  mutable std::mutex report_mutex_;
  mutable CycleReport report_;
};

}  // namespace coglab_controllers
