/// @file
/// Configurator (D4.10 Figure 1): executes the slow requests, entering and leaving command mode.
/// Each has a time limit and an outcome.
///
/// Every FRI tick makes one step (time-outs of the FRI thread do so if the controller is silent).
/// The configurator never waits, so it runs in the same thread as the supervisor and is
/// reproducible in lockstep.
#pragma once

#include "lwr_fri_bridge/requests/events.hpp"

namespace lwr_fri_bridge {

struct ConfiguratorLimits {
  double start_timeout = 10.0;  ///< s, from the request to command mode with power; KRL programs
                                ///< may need some seconds
  double stop_timeout = 2.0;    ///< s, from the request to monitor mode
  double silent_stop_timeout = 1.0;  ///< s, the same for a silent controller
};

/// Real-time safe, one thread.
class Configurator {
 public:
  Configurator(fri::KrlConvention convention, std::int32_t tool, const ConfiguratorLimits& limits)
      : convention_(convention), limits_(limits) {
    request_.tool = tool;
  }

  /// Observation of one tick. `measurement` is the newest one, also if the controller is silent.
  struct Observation {
    bool connected = false;
    const fri::MeasurementDatagram* measurement = nullptr;
    std::int64_t now_ns = 0;
  };

  /// Begins to enter command mode with `strategy`. Interrupts a request in progress.
  void start(std::uint32_t ticket, fri::ControlStrategy strategy, const Observation& seen);
  /// Begins to leave command mode.
  void stop(std::uint32_t ticket, const Observation& seen);
  /// Ends a start in progress with `code` and withdraws it from the KRL program.
  void abandon(OutcomeCode code, const Observation& seen);
  /// Call this if the controller left command mode by itself. Withdraws the request, which would
  /// start command mode again.
  void fellBack() {
    if (request_.phase == fri::KrlPhase::Running) request_.phase = fri::KrlPhase::Idle;
  }

  /// One step. Returns true if a request ended, and fills `outcome`.
  bool update(const Observation& seen, Outcome& outcome);

  /// Writes the current request for the KRL program.
  void write(fri::UserData& to_controller) const {
    fri::writeRequest(convention_, request_, to_controller);
  }

  bool busy() const { return step_ != Step::Idle; }
  fri::KrlConvention convention() const { return convention_; }

 private:
  enum class Step : std::uint8_t { Idle, WaitQuality, WaitCommand, WaitPower, WaitMonitor, Ended };

  double elapsed(const Observation& seen) const {
    return 1e-9 * static_cast<double>(seen.now_ns - began_ns_);
  }
  void finish(OutcomeCode code, const Observation& seen);
  void setPhase(fri::KrlPhase phase, const Observation& seen);
  void stepStart(const Observation& seen);
  void waitCommand(const Observation& seen, bool late);
  void waitPower(const Observation& seen, bool command, bool late);
  void giveUp(OutcomeCode code, const Observation& seen);
  void stepStop(const Observation& seen);

  fri::KrlConvention convention_;
  ConfiguratorLimits limits_;
  fri::KrlRequest request_;
  Step step_ = Step::Idle;
  std::int64_t began_ns_ = 0;
  bool seen_busy_ = false;
  bool settle_ = false;  // after a withdrawn start, monitor mode must last for some time
  std::int64_t monitor_since_ns_ = 0;
  fri::KrlReply reply_;
  Outcome outcome_;
};

}  // namespace lwr_fri_bridge
