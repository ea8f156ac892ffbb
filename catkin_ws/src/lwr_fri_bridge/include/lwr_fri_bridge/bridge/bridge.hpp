/// @file
/// The bridge computes the answer to one datagram, with FRI session, Interpolator, VelocityFilter,
/// Supervisor and Configurator (D4.10 Figure 1). It has no socket and no thread, so the FRI thread,
/// lockstep tests and a simulation in virtual time run the same code. Threads:
/// docs/architecture.md.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>

#include "lwr_fri_bridge/bridge/bridge_config.hpp"
#include "lwr_fri_bridge/bridge/snapshot.hpp"
#include "lwr_fri_bridge/fri/session.hpp"
#include "lwr_fri_bridge/motion/set_point_leash.hpp"
#include "lwr_fri_bridge/motion/tool_frame.hpp"
#include "lwr_fri_bridge/motion/velocity_filter.hpp"

namespace lwr_fri_bridge {

/// Source of the target velocities that the bridge follows.
enum class VelocitySource : std::uint8_t {
  ControlThread,  ///< mailboxes(), in the same process
  Topic           ///< sendTopicVelocity(), from target_joint_states
};

/// One thread at a time calls answer() or idle(). The sections below give the threads of the other
/// methods.
class Bridge {
 public:
  /// @throws std::invalid_argument if a parameter is out of range.
  explicit Bridge(const BridgeConfig& config);

  // --- FRI thread (or lockstep). Real-time safe: no allocation, lock, syscall or exception.

  /// One FRI tick: checks the datagram of `size` bytes received at `now_ns` (steady or simulated
  /// clock) and fills `answer`. Returns false if the datagram gets no answer (see fri::Verdict); it
  /// is then counted.
  bool answer(const std::uint8_t* datagram, std::size_t size, std::int64_t now_ns,
              fri::CommandDatagram& answer);

  /// answer() in two halves, so that the caller can send the datagram between them. compute() fills
  /// the answer. publish() then publishes the tick to the other threads. Call publish() only after
  /// compute() returned true.
  bool compute(const std::uint8_t* datagram, std::size_t size, std::int64_t now_ns,
               fri::CommandDatagram& answer);
  void publish();

  /// Call this if no datagram came for some time. It checks time limits, and sets `disconnected`
  /// after the receive time limit.
  void idle(std::int64_t now_ns);

  /// Records that the FRI thread was `seconds` late for its next datagram or its time-out.
  void noteLate(double seconds) { watch_.late(seconds); }
  /// Set to true if the controller runs on this computer. Its silence is then caused by this
  /// computer.
  void setControllerHere(bool here) { watch_.setControllerHere(here); }

  /// True if a datagram came within the receive time limit, at the last answer() or idle().
  bool connected() const { return connected_; }
  /// FRI period of the newest measurement, s; 0 before the first. FRI thread only.
  double cycleTime() const { return sample_.cycle_time; }

  // --- control thread

  /// Mailboxes of the control thread.
  ArmMailboxes& mailboxes() { return mailboxes_; }

  // --- other threads

  /// Accepts an event (see events.hpp) and returns a ticket for its outcome. Any thread except the
  /// FRI thread.
  /// @throws std::invalid_argument if the event is unknown or its parameters are not valid.
  std::uint32_t submit(const std::string& event);
  /// Outcome of a ticket; Pending until the request ends. At most 64 outcomes are kept until they
  /// are fetched.
  Outcome outcome(std::uint32_t ticket);
  /// Submits an event and waits for its outcome (steady clock, at most the time limits of the
  /// request plus 2 s). Not for lockstep.
  Outcome command(const std::string& event);

  /// Sets a target velocity from target_joint_states. One thread. Used if the source is Topic.
  void sendTopicVelocity(const VelocityCommand& command) { topic_.write(command); }
  void setVelocitySource(VelocitySource source) {
    source_.store(source, std::memory_order_relaxed);
  }

  /// Newest snapshot. Any thread except the FRI thread.
  Snapshot snapshot();
  /// Fetches the next change of the state. Returns false if there is none. One thread.
  bool nextStateChange(StateView& view) { return changes_.pop(view); }

  const BridgeConfig& config() const { return config_; }

 private:
  /// s; after this time monitor mode is requested even if the arm still moves
  static constexpr double kBrakeTimeLimit = 3.0;

  struct Request {
    std::uint32_t ticket = 0;
    Event event;
  };
  /// A stop in progress. First the arm brakes, then monitor mode is requested.
  struct PendingStop {
    std::uint32_t ticket = 0;
    std::int64_t began_ns = 0;
    bool monitor_asked = false;
  };
  /// Newest valid target velocity with its source; `expired` if it is too old.
  struct Target {
    VelocityCommand command;
    VelocitySource source = VelocitySource::ControlThread;
    bool expired = false;
  };
  void serveRequests(const Configurator::Observation& seen);
  void serve(const Request& request, const Configurator::Observation& seen);
  void finish(const Request& request, OutcomeCode code);
  void runSupervision(const Configurator::Observation& seen, bool fresh_session);
  void move(const fri::Reception& reception, fri::CommandDatagram& answer);
  void mirror(fri::CommandDatagram& answer);
  void takeOver(const fri::Reception& reception);
  void follow(const fri::Reception& reception, fri::CommandDatagram& answer);
  void noteSent(const Vector7& from, const fri::CommandDatagram& answer);
  Vector7 targetVelocity();
  void collectOutcomes();
  void fillMode(fri::CommandDatagram& answer) const;

  const BridgeConfig config_;
  ArmMailboxes mailboxes_;
  TripleBuffer<VelocityCommand> topic_;
  std::atomic<VelocitySource> source_{VelocitySource::ControlThread};

  // FRI thread
  fri::Session session_;
  fri::MeasurementDatagram measurement_{};
  VelocityFilter velocity_filter_;
  Interpolator interpolator_;
  BrakingGuard braking_;
  SetPointLeash leash_;
  CartesianSetPoint cartesian_;
  Supervisor supervisor_;
  Configurator configurator_;
  ControlMode wanted_mode_;  // for the next start
  ControlMode active_mode_;  // latched on leaving monitor mode
  RobotSample sample_;
  CommandModeWatch watch_;
  CommandModeLoss loss_;
  BridgeCounters counters_;
  Target target_;
  PendingStop stop_;
  std::int64_t last_receive_ns_ = 0;
  std::int64_t permission_since_ns_ = 0;
  unsigned bounded_joints_ = 0;
  bool connected_ = false;
  bool following_ = false;  // the last answer came from the interpolator
  StateView last_view_;

  // to and from the FRI thread
  EventRing<Request, 16> requests_;
  EventRing<Outcome, 64> outcomes_;
  EventRing<StateView, 128> changes_;
  TripleBuffer<Snapshot> snapshots_;

  // other threads
  std::mutex mutex_;
  std::uint32_t next_ticket_ = 1;
  std::uint64_t requests_dropped_ = 0;
  std::map<std::uint32_t, Outcome> ended_;
};

}  // namespace lwr_fri_bridge
