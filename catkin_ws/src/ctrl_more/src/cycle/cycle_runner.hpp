#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "ctrl_more/cycle/controller_entry.hpp"
#include "ctrl_more/log/logger.hpp"
#include "ctrl_more/states/control_states.hpp"
#include "ctrl_more/states/cycle.hpp"
#include "ctrl_more/states/robot_states.hpp"
#include "cycle/plan_exchange.hpp"
#include "cycle/record_exchange.hpp"

namespace ctrl_more {

/// The cycle's side of a manager: adopts plans, and runs the controllers of a stage in order.
///
/// begin() to end() neither allocate nor lock nor throw.
class CycleRunner {
 public:
  /// @param robot shared robot states
  /// @param control shared control states
  /// @param options of the manager
  /// @param logger for what goes wrong in the cycle
  CycleRunner(RobotStates& robot, ControlStates& control, const ManagerOptions& options,
              Logger* logger);

  /// Fixes the layout of both stores and allocates what the cycle needs.
  void freeze();
  /// Starts a cycle with the newest plan.
  void begin(const Cycle& cycle) noexcept;
  /// Adopts what was prepared, if anything.
  void adoptPrepared() noexcept;
  /// Keeps the references as `original`, then runs the controllers of a stage in order.
  void runStage(Stage stage, const RobotStates& robot, ControlStates& control) noexcept;
  /// Closes the cycle.
  void end() noexcept;
  /// The cycle that runs, or ran last.
  const Cycle& cycle() const { return cycle_; }

  /// Where plans come from.
  PlanExchange& plans() { return plans_; }
  /// Number of the cycle, for log records of any thread.
  const std::atomic<std::uint64_t>& number() const { return number_; }
  /// A reader (one at a time): the newest complete buffer of records.
  /// @param cycle number of the cycle it is of
  unsigned acquireRecords(std::uint64_t& cycle);

 private:
  void adopt(const Plan* plan) noexcept;

  RobotStates& robot_;
  ControlStates& control_;
  const ManagerOptions options_;
  std::atomic<std::uint64_t> number_{0};  // before the plans, whose controllers log it
  LogSource log_;
  PlanExchange plans_;
  RecordExchange records_;
  std::uint64_t recorded_cycle_[2] = {0, 0};  // of each buffer; belongs to who has the buffer

  unsigned buffer_ = 0;    // of records, in this cycle
  bool recorded_ = false;  // anything in this cycle
  bool laid_out_ = false;  // freeze() was here
  const Plan* plan_ = nullptr;
  Cycle cycle_;
  ControlStates original_;
  std::vector<double> compared_;  // of the test mode
};

}  // namespace ctrl_more
