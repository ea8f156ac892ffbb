/// @file
/// The bridge: composes FRI session, Interpolator, VelocityFilter, Supervisor and Configurator
/// (D4.10 Figure 1) into the answer to one datagram. It owns no socket and no thread, so the FRI
/// thread, lockstep tests and a simulation in virtual time drive the same code. Threads:
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

/// Whose target velocities are followed.
enum class VelocitySource : std::uint8_t {
  ControlThread,  ///< mailboxes(), in one process
  Topic           ///< sendTopicVelocity(), from target_joint_states
};

/// One thread at a time drives it by answer() or idle(); what else it offers says which thread may
/// ask.
class Bridge {
 public:
  /// @throws std::invalid_argument if a parameter is out of range.
  explicit Bridge(const BridgeConfig& config);

  // --- FRI thread (or lockstep). Real-time safe: no allocation, lock, syscall or exception.

  /// One FRI tick: judges the datagram of `size` bytes received at `now_ns` (steady or simulated
  /// clock) and fills `answer`. Returns false if the datagram deserves none (see fri::Verdict); it
  /// is counted.
  bool answer(const std::uint8_t* datagram, std::size_t size, std::int64_t now_ns,
              fri::CommandDatagram& answer);

  /// answer() in two halves, so that the caller can send the datagram between them: compute() fills
  /// the answer, publish() then shows the tick to the other threads. publish() only after a
  /// compute() that returned true.
  bool compute(const std::uint8_t* datagram, std::size_t size, std::int64_t now_ns,
               fri::CommandDatagram& answer);
  void publish();

  /// To be called when no datagram came for some time: time limits go on, silence becomes
  /// `disconnected`.
  void idle(std::int64_t now_ns);

  /// The FRI thread came `seconds` too late to the datagram that it takes next, or to its time-out.
  void noteLate(double seconds) { watch_.late(seconds); }
  /// Whether the controller runs on this computer: then its silence is this computer's doing.
  void setControllerHere(bool here) { watch_.setControllerHere(here); }

  /// Whether datagrams have come within the receive time limit, as of the last answer() or idle().
  bool connected() const { return connected_; }
  /// FRI period of the newest measurement, s; 0 before the first. FRI thread only.
  double cycleTime() const { return sample_.cycle_time; }

  // --- control thread

  /// Mailboxes of the one control thread.
  ArmMailboxes& mailboxes() { return mailboxes_; }

  // --- other threads

  /// Accepts an event (see events.hpp) and returns a ticket for its outcome. Callable from any
  /// thread but the FRI thread.
  /// @throws std::invalid_argument if the event is unknown or its parameters are not valid.
  std::uint32_t submit(const std::string& event);
  /// Outcome of a ticket, Pending until it ends. An outcome is kept until it has been fetched, at
  /// most 64 of them.
  Outcome outcome(std::uint32_t ticket);
  /// Submits and waits (steady clock, bounded by the request's own time limits plus 2 s); not for
  /// lockstep.
  Outcome command(const std::string& event);

  /// A target velocity from target_joint_states. One thread. Followed if the source is Topic.
  void sendTopicVelocity(const VelocityCommand& command) { topic_.write(command); }
  void setVelocitySource(VelocitySource source) {
    source_.store(source, std::memory_order_relaxed);
  }

  /// Newest snapshot. Any thread but the FRI thread.
  Snapshot snapshot();
  /// Next change of the state that was not fetched yet. One thread.
  bool nextStateChange(StateView& view) { return changes_.pop(view); }

  const BridgeConfig& config() const { return config_; }

 private:
  /// s for the arm to come to rest before monitor mode is requested anyway
  static constexpr double kBrakeTimeLimit = 3.0;

  struct Request {
    std::uint32_t ticket = 0;
    Event event;
  };
  /// A stop in progress: first the arm brakes, then monitor mode is requested.
  struct PendingStop {
    std::uint32_t ticket = 0;
    std::int64_t began_ns = 0;
    bool monitor_asked = false;
  };
  /// The newest valid target velocity, where it came from, and whether it is too old.
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
