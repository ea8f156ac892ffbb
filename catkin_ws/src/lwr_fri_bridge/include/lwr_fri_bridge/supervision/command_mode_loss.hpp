/// @file
/// Cause of a loss of command mode, as far as the PC can find it, and automatic restarts.
///
/// FRI gives no reason for a fall-back. The usual causes differ in the PC's observations just
/// before it: late answers, silence, lost packets, power.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "lwr_fri_bridge/names.hpp"

namespace lwr_fri_bridge {

enum class LossCause : std::uint8_t {
  None,               ///< command mode was not lost since the last start
  ComputerLate,       ///< the FRI thread of this computer ran too late
  ControllerStalled,  ///< silence of a controller on this computer
  ControllerSilent,   ///< silence of a controller on another computer
  PacketsLost,        ///< datagrams were lost
  PowerLost,          ///< not all drives have power
  BeganAnew,          ///< the controller's counter restarted
  LeftByController    ///< another reason, known only to the controller
};

/// One loss of command mode.
struct CommandModeLoss {
  LossCause cause = LossCause::None;
  double seconds = 0.0;    ///< lateness or silence, s
  bool at_rest = false;    ///< the arm stood still before the loss, commanded and measured
  float timestamp = 0.0F;  ///< controller's clock at the loss, s
  Vector7 position = Vector7::Zero();  ///< measured at the loss, rad

  /// True if this computer caused the loss because it ran a program too late.
  bool byComputer() const {
    return cause == LossCause::ComputerLate || cause == LossCause::ControllerStalled;
  }
  bool operator==(const CommandModeLoss& other) const {
    return cause == other.cause && timestamp == other.timestamp;
  }
};

/// Text of the cause; empty for None.
std::string describe(const CommandModeLoss& loss);

/// Records events that may lead to a loss. FRI thread, real-time safe.
class CommandModeWatch {
 public:
  /// Records that the FRI thread was late, s.
  void late(double seconds) { late_ += seconds; }
  /// Sets whether the controller runs on this computer.
  void setControllerHere(bool here) { controller_here_ = here; }

  /// Call this after every accepted datagram. `seconds` since the last one, number of packets
  /// `lost` between them, largest joint speeds in rad/s.
  void tick(double seconds, std::uint32_t lost, double measured_speed, double commanded_speed);

  /// Observations at the loss of command mode.
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

/// Decides about an automatic restart. Conditions: this computer caused the loss; the arm stood
/// still then and has not moved since; the controller is the same; the number of restarts is
/// limited. Commands from before the loss are ignored, because a start begins a new epoch. One
/// thread.
class QuietRestart {
 public:
  /// Current observations.
  struct View {
    CommandModeLoss loss;
    bool stopped = false;      ///< supervisor: stopped
    bool held = false;         ///< hold is latched
    bool may_command = false;  ///< quality is OK or better, no drive error
    float timestamp = 0.0F;    ///< controller's clock, s
    Vector7 position = Vector7::Zero(), velocity = Vector7::Zero();  ///< measured
  };
  /// Checks the conditions. Returns true if a start should be requested now.
  bool due(const View& view, std::int64_t now_ns);

 private:
  bool mayRestart(const View& view) const;
  CommandModeLoss judged_;                     // last loss with a decision
  std::int64_t calm_since_ns_ = 0;             // 0: not calm
  std::array<std::int64_t, 3> restarts_ns_{};  // the last ones, oldest first; 0: none
};

}  // namespace lwr_fri_bridge
