/// @file
/// The controller manager without ROS (D4.10, Table 6): loads, lists, switches, and runs the
/// control cycle.
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

/// What a controller manager is made of. Everything but the robot has defaults.
struct ManagerSettings {
  std::shared_ptr<const RobotSetup> robot;
  CycleSettings cycle;
  /// Parameters of the plug-ins by their id, and those of the manager itself (see
  /// ControllerManager).
  YAML::Node parameters;
  /// Type name to library, for example coglab/DmpController: libcoglab_dmp_controller.so.
  std::map<std::string, std::string> types;
  std::vector<std::string> plugin_paths;  ///< folders of libraries that are given without a path
  std::string feedback_file;  ///< list file of Ctrl-MORE; empty: no feedback controllers
  double plan_timeout = 2.0;  ///< the longest that a request waits for the cycle, s
  bool lockstep = false;      ///< requests are adopted by the caller's own thread, nothing is timed
  std::function<std::int64_t()>
      clock;  ///< time of the samples' stamps, ns; empty: the steady clock
  ctrl_more::Logger* logger = nullptr;  ///< of feedback controllers; null: Logger::standard()
};

/// Reads the manager's own parameters: `cycle_time` (0.005 s), `sample_timeout`, `silent_time`,
/// `overrun_time` (s), `plan_timeout` (s), `speed_scale`, `types` (block: type -> library; the two
/// of this package are known), `plugin_paths`, `feedback_file`, and those of makeRobotSetup().
/// @throws std::runtime_error naming the parameter
ManagerSettings readManagerSettings(const YAML::Node& parameters, const std::string& urdf,
                                    const coglab_rt::JointLimits& table, bool lockstep);

/// One motion controller that is loaded.
struct LoadedMotion {
  std::string id, type;
  std::shared_ptr<ctrl_more::PluginLibrary> library;  ///< null for types linked into the program
  std::unique_ptr<MotionController> controller;
  std::shared_ptr<MotionCancel> cancel = std::make_shared<MotionCancel>();
};

/// Loads controllers and decides which one is active. Services call it from any thread; requests
/// come one after another. The control thread uses cycle() alone.
class ControllerManager : public MotionHost {
 public:
  explicit ControllerManager(ManagerSettings settings);
  ~ControllerManager() override;
  ControllerManager(const ControllerManager&) = delete;
  ControllerManager& operator=(const ControllerManager&) = delete;

  /// @name Requests of Table 6
  /// @{

  /// What a controller gets from the user of the manager before anybody can use it, such as its
  /// services. Throws if it cannot have that: then the controller is not loaded.
  using Attach = std::function<void(MotionController&, const MotionMaker&)>;

  /// Loads a controller of a type under an id: a motion controller, or a feedback controller if the
  /// type is one of Ctrl-MORE's. All or nothing, whatever the plug-in throws.
  Answer load(const std::string& id, const std::string& type, const Attach& attach = {});
  /// Keeps an id for a controller that is being loaded, until the result is gone; null if the id is
  /// in use.
  std::shared_ptr<void> claim(const std::string& id);
  /// What has to end before a controller that is unloaded may go: its services. It keeps the
  /// controller for as long as it needs it.
  using Detach = std::function<void(std::shared_ptr<const LoadedMotion>)>;

  /// Unloads a motion or feedback controller. The active motion controller is refused.
  Answer unload(const std::string& id, const Detach& detach = {});
  /// Ids and types of all loaded controllers, in load order; feedback controllers after motion
  /// controllers.
  void list(std::vector<std::string>& ids, std::vector<std::string>& types) const;
  /// Makes a motion controller the active one, and applies the feedback profile of its name. The
  /// one that is active already goes on undisturbed, unless it is at fault: then it starts afresh.
  /// An empty id: none is active; what moves the arm ends, feedback controllers stay as they are.
  Answer switchTo(const std::string& id, std::string& type);
  /// Id and type of the active one; empty if there is none.
  void active(std::string& id, std::string& type) const;
  /// Enables exactly the feedback controllers of a profile, for example dmp_compliant during an
  /// approach.
  Answer applyProfile(const std::string& profile);
  /// 0 (stand still) to 1.
  Answer setSpeedScale(double scale);
  /// @}

  /// @name Cancel: ends the running motion of a controller and all that waits behind it
  /// @{

  /// Ends it and waits until the arm stands. Never waits for other requests. Not in lockstep.
  /// @param time_limit the longest wait, s, at most 10; 0 or less: 2
  /// @param why who ends the motion and why, for the log; may be empty
  CancelAnswer cancel(const std::string& id, double time_limit, const std::string& why);
  /// The same without waiting: the next cycle ends the motion, and requests made before are void.
  CancelOrder askCancel(const std::string& id, const std::string& why);
  /// Whether a cancel has come to its end: the arm stands, or there is nothing to end.
  bool cancelEnded(const CancelOrder& order, CancelAnswer& answer) const;
  /// The answer to one that has not.
  CancelAnswer cancelUnfinished(const CancelOrder& order, double waited) const;
  /// Ends every wait of cancel() now: the program ends.
  void endWaits() { ending_.store(true, std::memory_order_relaxed); }
  /// @}

  /// A loaded motion controller; null if the id is unknown. Valid until it is unloaded.
  MotionController* motion(const std::string& id);

  ctrl_more::FeedbackControllersManager& feedback() { return feedback_.manager(); }
  /// Forces of the hand's touch sensors, see FeedbackStage::postTouch().
  bool postTouch(const TouchForces& forces, std::int64_t stamp_ns) noexcept {
    return feedback_.postTouch(forces, stamp_ns);
  }
  /// What the feedback list file could not load, one sentence each.
  const std::vector<std::string>& feedbackErrors() const { return feedback_errors_; }
  ControlCycle& cycle() { return cycle_; }
  const ManagerSettings& settings() const { return settings_; }
  /// The newest report of the cycle; any thread.
  CycleReport report() const;
  /// Name of the feedback profile applied last.
  std::string profile() const;

  /// Requests that end in a plan come one after another; hold this while building one.
  std::unique_lock<std::mutex> lockRequests() { return std::unique_lock<std::mutex>(requests_); }
  /// Whether a new motion of this controller is welcome by this report; else what to do next.
  Answer motionWelcome(const std::string& controller_id, const CycleReport& now) const;

  // MotionHost
  std::int64_t now_ns() const override;
  double planTimeout() const override { return settings_.plan_timeout; }

 private:
  // The rest of MotionHost is for plug-ins, which know the manager by that interface alone.
  MotionRequest beginRequest(const std::string& controller_id) override;
  RobotSample robotSnapshot() const override { return report().robot; }
  std::function<void()> cycleWait() const override;
  /// Sentence for a plan that the cycle did not adopt; names the controller whose code the cycle is
  /// in.
  std::string notAdopted(PlanOutcome outcome) const override;

  Answer loadMotion(const std::string& id, const std::string& type, const Attach& attach);
  Answer loadFeedback(const std::string& id, const std::string& type);
  std::string libraryOf(const std::string& type) const;
  Answer planSwitch(const std::string& id, CyclePlan& plan, std::string& type);
  LoadedMotion* find(const std::string& id) const;  // under table_
  std::string loadedMotions() const;

  ManagerSettings settings_;
  FeedbackStage feedback_;
  ControlCycle cycle_;
  std::vector<std::string> feedback_errors_;

  std::atomic<bool> ending_{false};
  mutable std::mutex requests_;  // requests one after another
  mutable std::mutex table_;     // the members below, for short
  std::vector<std::shared_ptr<LoadedMotion>> motions_;
  std::set<std::string> loading_;  // ids that are on their way into motions_
  std::string active_id_, active_type_, profile_;
  mutable std::mutex report_mutex_;
  mutable CycleReport report_;
};

}  // namespace coglab_controllers
