/// @file
/// The whole robot in virtual time: simulated cell, FRI bridge and controller manager in one
/// process and one thread.
///
/// It uses the same libraries as on the real clock, in the same order: measurement, answer, control
/// cycle, next period. Only tick() advances time. Trials therefore run as fast as the machine can,
/// and the same requests give the same bytes.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "coglab_controllers/manager/controller_manager.hpp"
#include "coglab_controllers/motion/custom_motion_controller.hpp"
#include "coglab_controllers/plugins/dmp_controller.hpp"
#include "coglab_controllers/plugins/ptp_controller.hpp"
#include "coglab_controllers/plugins/stream_controller.hpp"
#include "coglab_sim/cell.hpp"
#include "coglab_sim/limit_watch.hpp"
#include "ctrl_more/log/logger.hpp"
#include "lwr_fri_bridge/bridge/bridge.hpp"

namespace coglab_sim {

/// A table of frames that replaces tf2. All poses are in `world`, which is `lwr_base_link`.
class WorldFrames : public coglab_controllers::GoalSource {
 public:
  /// Stores the pose of a frame, seen at `stamp_ns` (ns, robot's clock).
  void set(const std::string& frame, const Pose& in_world, std::int64_t stamp_ns);
  /// Stores a frame that does not move. refresh() stamps it.
  void setFixed(const std::string& frame, const Pose& in_world);
  /// Stamps the fixed frames as seen at `now_ns`.
  void refresh(std::int64_t now_ns);
  void forget(const std::string& frame) { frames_.erase(frame); }
  bool lookup(const std::string& reference, const std::string& frame,
              coglab_controllers::GoalObservation& observation, std::string& why) override;

 private:
  struct Seen {
    Pose pose;
    std::int64_t stamp_ns = 0;
    bool fixed = false;
  };
  bool find(const std::string& frame, Seen& seen) const;
  std::map<std::string, Seen> frames_;
};

/// Settings of a LockstepRobot.
struct LockstepRobotConfig {
  CellConfig cell;
  std::string limits_file;         ///< lwr_description/config/joint_limits.yaml
  std::string manager_parameters;  ///< YAML text as below /controller_manager
};

class LockstepRobot {
 public:
  /// @throws what Cell, Bridge and readManagerSettings() throw.
  explicit LockstepRobot(const LockstepRobotConfig& config);
  ~LockstepRobot();

  /// One FRI period. Then the limits are checked (limits()) and the report is read (report()).
  void tick();
  double now() const { return 1e-9 * static_cast<double>(now_ns_); }  ///< s
  std::int64_t nowNs() const { return now_ns_; }

  /// True stops bridge and manager, like SIGSTOP on their process. The cell continues without
  /// answers.
  void setFrozen(bool frozen) { frozen_ = frozen; }
  bool frozen() const { return frozen_; }

  /// Posts a message of a topic of the file of signals, as if it arrived now. IMU and wrench sensor
  /// of the palm post theirs in every tick, on the topics of cell_node.
  /// @param numbers of each field, by its name
  /// @param age s since the measurement
  /// @return why a row refuses it; empty: accepted
  /// @throws std::invalid_argument if no row has this topic, or its type no such field
  std::string postSignal(const std::string& topic,
                         const std::map<std::string, std::vector<double>>& numbers, double age,
                         const std::string& frame, const std::vector<std::string>& joints);

  /// The control cycle's report after the newest tick.
  const coglab_controllers::CycleReport& report() const { return report_; }
  /// Violations of limits by commands and true joints so far.
  const LimitWatch& limits() const { return limits_; }

  Cell& cell() { return cell_; }
  lwr_fri_bridge::Bridge& bridge() { return bridge_; }
  coglab_controllers::ControllerManager& manager() { return *manager_; }
  WorldFrames& frames() { return frames_; }

  /// Loads a controller; a DMP controller gets the frame table as goal source.
  coglab_controllers::Answer load(const std::string& id, const std::string& type);
  /// Loads a motion of the caller as a controller with this id, and a type that no library has.
  coglab_controllers::Answer add(const std::string& id, const std::string& type,
                                 std::unique_ptr<coglab_controllers::Motion<>> motion);
  /// The controller of a motion from add(). @throws std::invalid_argument if there is none
  coglab_controllers::CustomMotionController& motion(const std::string& id);
  /// The controller of that id. @throws std::invalid_argument if there is none of that type.
  coglab_controllers::DmpController& dmp(const std::string& id = "dmp");
  coglab_controllers::PtpController& ptp(const std::string& id = "ptp");
  /// The same for a stream of velocities.
  coglab_controllers::StreamController& stream(const std::string& id);

 private:
  bool answer(std::array<std::uint8_t, lwr_fri_bridge::fri::kCommandSize>& bytes);
  void controlCycle(bool answered);
  void postPalm();

  Cell cell_;
  lwr_fri_bridge::Bridge bridge_;
  std::int64_t now_ns_ = 1'000'000'000;  // a stamp of 0 would mean "none"
  bool measured_ = false;
  bool frozen_ = false;
  int since_cycle_ = 0;
  std::int64_t last_controller_ns_ = 0;  // stamp of the last control cycle's sample
  WorldFrames frames_;
  ctrl_more::Logger
      logger_;  // of the feedback stage; has no sink, because requests return their errors
  std::unique_ptr<coglab_controllers::ControllerManager> manager_;
  std::vector<coglab_controllers::DmpController*> dmps_;
  coglab_controllers::CycleReport report_;
  LimitWatch limits_;
  bool has_palm_imu_ = false, has_palm_wrench_ = false;  // in the file of signals
};

}  // namespace coglab_sim
