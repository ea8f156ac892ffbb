/// @file
/// The robot controller (KRC) behind FRI: session state, statistics, checks, drives, KRL program.
///
/// Per FRI period: call `receive()` for every datagram, then `tick()`. It checks the answer to the
/// last measurement and returns the servo command for the next period. After the arm has moved,
/// `measure()` returns the next measurement.
#pragma once

#include <deque>
#include <memory>
#include <string>

#include "coglab_sim/krc/answer_statistics.hpp"
#include "coglab_sim/krc/command_checks.hpp"
#include "coglab_sim/krc/krl_program.hpp"
#include "coglab_sim/krc/parameters.hpp"
#include "coglab_sim/krc/servos.hpp"

namespace coglab_sim::krc {

/// A line of the controller's message window.
struct Message {
  double time = 0.0;  ///< s since start
  std::string text;
};

/// Numbers of rejected datagrams, by reason.
struct Rejections {
  std::uint64_t wrong_size = 0;    ///< datagram is not 376 bytes
  std::uint64_t wrong_header = 0;  ///< id or size field
  std::uint64_t stale = 0;         ///< does not reflect the last measurement's counter
  std::uint64_t repeated = 0;      ///< counter did not advance
};

/// Set-points of one FRI period for the joint servos.
struct PeriodCommand {
  Vector7 from, to;    ///< rad, interpolated linearly over the period
  ServoCommand servo;  ///< everything but position and velocity
  Pose frame_from, frame_to;
};

/// Signals of the arm for a measurement.
struct ArmSignals {
  Vector7 position;         ///< rad
  Vector7 torque;           ///< measured, Nm
  Vector7 external_torque;  ///< estimated, Nm
};

class Controller : private KrlInterface {
 public:
  /// @throws std::invalid_argument naming parameter, value and range if one is out of range.
  Controller(const Parameters& parameters, const ServoParameters& servos, const Vector7& position);
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;

  /// Takes a datagram that arrived `latency` s after the last measurement.
  void receive(const std::uint8_t* bytes, std::size_t size, double latency);

  /// Ends the time for an answer. `on_time` false: the simulation itself was late, so that a
  /// missing answer is bridged but not counted.
  /// @param arm  state of the arm now
  PeriodCommand tick(const Servos& arm, bool on_time);

  /// Returns the next measurement with its counters.
  lwr_fri_bridge::fri::MeasurementDatagram measure(const Servos& arm, const ArmSignals& signals);

  bool brakesWanted() const { return !drives_on_; }
  bool sends() const {
    const bool open = state_ != lwr_fri_bridge::fri::FriState::Off || time_ < lingers_until_;
    return open && silent_until_ <= time_;
  }

  // Actions of people, and faults
  void setEnablingSwitch(
      bool pressed);  ///< in T1/T2; stands for the operator safety gate in Automatic
  void setDriveError(int joint, bool on);            ///< joint 0..6; switches all drives off
  void setSilent(double duration);                   ///< sends nothing for `duration` s
  void leaveCommandMode(const std::string& reason);  ///< as after a fault
  void acknowledge();  ///< operator acknowledges messages; drives may be switched on again
  /// Restarts the KRL program with another FRI period (s). FRI closes, nothing is sent for `pause`
  /// s, then the program opens FRI again. @throws std::invalid_argument naming value and range of
  /// the period.
  void restartProgram(double period, double pause);

  double time() const { return time_; }
  lwr_fri_bridge::fri::FriState friState() const { return state_; }
  lwr_fri_bridge::fri::Quality friQuality() const { return statistics_.quality(); }
  lwr_fri_bridge::fri::ControlStrategy strategy() const { return strategy_; }
  std::uint16_t power() const;
  /// Commanded position: own interpolator plus FRI offset, rad.
  Vector7 setPoint() const { return own_ + offset_; }
  const AnswerStatistics& statistics() const { return statistics_; }
  const Rejections& rejections() const { return rejections_; }
  /// Number of set-points in command mode beyond a software limit switch: commanded ones, and ones
  /// extrapolated for missing answers.
  std::uint64_t limitSwitches() const { return limit_switches_; }
  const std::deque<Message>& messages() const { return messages_; }  ///< newest last, at most 200
  std::uint64_t messageCount() const { return message_count_; }
  const Parameters& parameters() const override { return parameters_; }

 private:
  // KrlInterface
  std::int32_t frmInt(int index) const override { return krl_in_.ints[index - 1]; }
  float frmReal(int index) const override { return krl_in_.reals[index - 1]; }
  bool frmBool(int index) const override { return ((krl_in_.bools >> (index - 1)) & 1) != 0; }
  void setToInt(int index, std::int32_t value) override { krl_out_.ints[index - 1] = value; }
  void setToReal(int index, float value) override { krl_out_.reals[index - 1] = value; }
  void setToBool(int index, bool value) override;
  lwr_fri_bridge::fri::FriState state() const override { return state_; }
  lwr_fri_bridge::fri::Quality quality() const override { return statistics_.quality(); }
  int krlStrategy() const override { return 10 * static_cast<int>(strategy_); }
  bool setKrlStrategy(int strategy) override;
  bool drivesReady() const override { return power() == lwr_fri_bridge::fri::kAllDrivesOn; }
  void friOpen(double period) override;
  lwr_fri_bridge::fri::FriState friStart(double scale) override;
  void friStop() override;
  void friClose() override;
  void nudge() override;
  void setJointImpedance(const Vector7& stiffness, const Vector7& damping) override;
  void setCartesianImpedance(const Vector6& stiffness, const Vector6& damping) override;
  void show(const std::string& message) override;

  CheckContext checkContext() const;
  void follow(const lwr_fri_bridge::fri::CommandDatagram& command);
  void extrapolate();
  void judgeAnswer(const Servos& arm, bool on_time);
  void updateDrives(const Servos& arm);
  void watchTorque(const Servos& arm);
  void holdMeasured(const Servos& arm);
  ServoCommand servoCommand() const;

  Parameters parameters_;
  ServoParameters servo_parameters_;
  AnswerStatistics statistics_;
  std::unique_ptr<KrlProgram> program_;
  double time_ = 0.0, krl_due_ = 0.0, silent_until_ = 0.0;
  double lingers_until_ = 0.0;  // measurements go on after friClose

  lwr_fri_bridge::fri::FriState state_ = lwr_fri_bridge::fri::FriState::Off;
  lwr_fri_bridge::fri::ControlStrategy strategy_ = lwr_fri_bridge::fri::ControlStrategy::Position;
  double start_scale_ = 1.0;
  // Defaults of $STIFFNESS, used where the PC gives no value.
  Vector7 joint_stiffness_, joint_damping_;
  Vector6 frame_stiffness_, frame_damping_;
  double opens_at_ = 0.0;  // earliest time of the program's restart

  // Wire
  std::uint16_t counter_ = 0;  // of the last measurement
  bool measured_once_ = false;
  std::uint16_t peer_counter_ = 0;
  bool peer_known_ = false;
  bool answered_ = false;
  double answer_latency_ = 0.0;
  lwr_fri_bridge::fri::CommandDatagram answer_{};
  lwr_fri_bridge::fri::UserData krl_in_{}, krl_out_{};
  Rejections rejections_;
  std::uint64_t limit_switches_ = 0;
  int missed_in_row_ = 0;

  // Set-points
  Vector7 own_, offset_ = Vector7::Zero(), last_step_ = Vector7::Zero();
  Pose frame_own_, frame_;  // set-point of the tip: of the KRC alone, and with FRI
  lwr_fri_bridge::fri::CommandDatagram latched_{};  // impedance values in force
  std::uint32_t flags_ = 0;                         // latched at entry

  // Drives
  bool drives_on_ = false, enabled_ = true, error_latched_ = false, entry_pending_ = false;
  double drives_on_at_ = -1.0;  // time at which a running nudge ends; < 0: none runs
  std::uint16_t drive_error_ = 0;
  Vector7 saturated_ = Vector7::Zero();  // s, time of each motor at its limit
  Vector7 temperature_;

  std::deque<Message> messages_;
  std::uint64_t message_count_ = 0;
};

}  // namespace coglab_sim::krc
