/// @file
/// Why command mode was lost, as far as the PC's side can tell, and whether it may be entered again
/// without asking anybody.
///
/// FRI gives no reason for a fall-back. What this side sees just before it tells the usual causes
/// apart: answers that left late, silence, packets lost on the way, power.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "lwr_fri_bridge/names.hpp"

namespace lwr_fri_bridge {

enum class LossCause : std::uint8_t {
  None,               ///< command mode was not lost since the last start
  ComputerLate,       ///< the FRI thread of this computer was not run in time
  ControllerStalled,  ///< silence of a controller that runs on this computer itself
  ControllerSilent,   ///< silence of a controller elsewhere
  PacketsLost,        ///< datagrams got lost on the way
  PowerLost,          ///< not all drives have power
  BeganAnew,          ///< the controller's counter began anew
  LeftByController    ///< none of these: the controller has its own reason
};

/// One loss of command mode.
struct CommandModeLoss {
  LossCause cause = LossCause::None;
  double seconds = 0.0;    ///< how late, or how long silent
  bool at_rest = false;    ///< the arm had stood still for some time, commanded and measured
  float timestamp = 0.0F;  ///< the controller's clock then, s
  Vector7 position = Vector7::Zero();  ///< measured then, rad

  /// This computer caused it by running a program too late.
  bool byComputer() const {
    return cause == LossCause::ComputerLate || cause == LossCause::ControllerStalled;
  }
  bool operator==(const CommandModeLoss& other) const {
    return cause == other.cause && timestamp == other.timestamp;
  }
};

/// The cause in words; empty for None.
std::string describe(const CommandModeLoss& loss);

/// Watches what may lead to a loss. FRI thread, real-time safe.
class CommandModeWatch {
 public:
  /// The FRI thread came so many seconds too late.
  void late(double seconds) { late_ += seconds; }
  /// The controller runs on this computer.
  void setControllerHere(bool here) { controller_here_ = here; }

  /// After every accepted datagram: the seconds since the last one, packets lost between them, the
  /// greatest joint speeds, rad/s.
  void tick(double seconds, std::uint32_t lost, double measured_speed, double commanded_speed);

  /// What is known when command mode is lost.
  struct Facts {
    bool connected = false, fresh_session = false, command_mode = false;
    double silence = 0.0;     ///< s
    double cycle_time = 0.0;  ///< s
    float timestamp = 0.0F;
    Vector7 position = Vector7::Zero();
  };
  CommandModeLoss judge(const Facts& facts) const;

 private:
  // Both fade with a time constant of 1 s.
  double late_ = 0.0;  // s
  double lost_ = 0.0;  // packets
  double rest_ = 0.0;  // s that the arm has stood still
  bool controller_here_ = false;
};

/// Decides about a restart that nobody asked for. It is allowed only after a loss that this
/// computer caused, with an arm that stood still then and has not moved since, at the same
/// controller, and not over and over. What was commanded before the loss does not count afterwards:
/// a start begins a new epoch. One thread.
class QuietRestart {
 public:
  /// What is seen now.
  struct View {
    CommandModeLoss loss;
    bool stopped = false;      ///< supervisor: stopped
    bool held = false;         ///< hold is latched
    bool may_command = false;  ///< quality is OK or better, no drive error
    float timestamp = 0.0F;    ///< the controller's clock, s
    Vector7 position = Vector7::Zero(), velocity = Vector7::Zero();  ///< measured
  };
  /// One look. True: ask for a start now.
  bool due(const View& view, std::int64_t now_ns);

 private:
  bool mayRestart(const View& view) const;
  CommandModeLoss judged_;                     // the loss that was decided about last
  std::int64_t calm_since_ns_ = 0;             // 0: not calm
  std::array<std::int64_t, 3> restarts_ns_{};  // the last ones, oldest first; 0: none
};

}  // namespace lwr_fri_bridge
