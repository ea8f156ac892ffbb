#include "cell_faults.hpp"

#include <cmath>
#include <functional>
#include <stdexcept>

#include "coglab_sim/ranges.hpp"

namespace coglab_sim {
namespace {

constexpr double kReopenPause = 0.5;  // s between friClose and friOpen

using Action = std::function<void(Cell&)>;

/// Action of a fault, and the action that undoes it (empty if it ends by itself).
struct Fault {
  Action make, undo;
};

Fault faultOf(const std::string& kind, double value) {
  if (!std::isfinite(value)) throw std::invalid_argument("value must be a finite number");
  const bool on = value != 0.0;
  if (kind == "block")
    return {[on](Cell& cell) { cell.setBlock(on); }, [on](Cell& cell) { cell.setBlock(!on); }};
  if (kind == "packet_loss") {
    return {[value](Cell& cell) { cell.setLoss(value, value); },
            [](Cell& cell) { cell.setLoss(0.0, 0.0); }};
  }
  if (kind == "lose_packets") {
    requireWithin("fault/lose_packets", value);
    return {[value](Cell& cell) { cell.loseNext(static_cast<int>(value)); }, {}};
  }
  if (kind == "silence") {
    requireWithin("fault/silence", value);
    return {[value](Cell& cell) { cell.controller().setSilent(value); }, {}};
  }
  if (kind == "drive_error") {
    const int joint = static_cast<int>(value);
    return {[joint](Cell& cell) { cell.controller().setDriveError(joint, true); },
            [joint](Cell& cell) {
              cell.controller().setDriveError(joint, false);
              cell.controller().acknowledge();
            }};
  }
  if (kind == "enabling_switch") {
    return {[on](Cell& cell) { cell.controller().setEnablingSwitch(on); },
            [on](Cell& cell) { cell.controller().setEnablingSwitch(!on); }};
  }
  if (kind == "leave_command_mode") {
    return {[](Cell& cell) { cell.controller().leaveCommandMode("fault injected"); }, {}};
  }
  if (kind == "reopen") {
    return {[value](Cell& cell) { cell.controller().restartProgram(value, kReopenPause); }, {}};
  }
  if (kind == "acknowledge") return {[](Cell& cell) { cell.controller().acknowledge(); }, {}};
  throw std::invalid_argument(
      "unknown fault '" + kind +
      "'; known: block, packet_loss, lose_packets, silence, drive_error, enabling_switch, "
      "leave_command_mode, reopen, acknowledge");
}

}  // namespace

void injectFault(RealTimeCell& cell, const std::string& kind, double value, double duration) {
  Fault fault = faultOf(kind, value);
  cell.apply(std::move(fault.make));
  if (duration > 0.0 && fault.undo) cell.applyLater(duration, std::move(fault.undo));
}

}  // namespace coglab_sim
