/// @file
/// The cell on a real clock: one thread runs the FRI periods and the UDP socket. No ROS here.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "coglab_sim/cell.hpp"
#include "coglab_sim/fri_socket.hpp"

namespace coglab_sim {

/// Log record of one FRI period.
struct TickRecord {
  double time = 0.0;  ///< s, simulated, at the end of the period
  int state = 0, quality = 0, power = 0, control = 0;
  bool answered = false;        ///< true: the last measurement was answered in time
  Vector7 commanded, measured;  ///< rad
};

/// Copy of the cell's state, for other threads.
struct CellSnapshot {
  CellTruth truth;
  MotorStates motors;
  plant::Touch touch;
  PalmReading palm;
  std::int64_t stepped_ns = 0;   ///< steady clock, time of the last physics step
  std::uint64_t tick = 0;        ///< number of periods so far
  std::uint64_t late_ticks = 0;  ///< periods that the thread began too late
  std::uint64_t answers = 0;     ///< datagrams received so far
  std::uint64_t sent = 0;        ///< measurements sent in time
  std::uint64_t unanswered = 0;  ///< of these: not answered within the period
  double latest = 0.0;           ///< s, largest delay of a period since takeLatest()
  /// Reason why the person's hand was refused; empty: accepted.
  std::string refused_hand;
};

/// Runs a Cell in real time times a factor.
class RealTimeCell {
 public:
  /// @param factor  simulated over real time, 0.01 .. 100
  /// @param source_port  UDP port of the controller, 0: any free port
  /// @throws what Cell and FriSocket throw, std::invalid_argument for the factor
  RealTimeCell(const CellConfig& config, const std::string& host, std::uint16_t port, double factor,
               std::uint16_t source_port = 0);
  ~RealTimeCell();
  RealTimeCell(const RealTimeCell&) = delete;
  RealTimeCell& operator=(const RealTimeCell&) = delete;

  /// Starts the thread `cell`. It gets SCHED_FIFO with `priority` (0: none) if the system grants
  /// it, because a real controller is a separate real-time computer. Faster than real time it stays
  /// a normal thread; otherwise other programs would starve. Returns an empty string, or why the
  /// thread is a normal one.
  /// @pre not running
  std::string start(int priority = 0);
  void stop();
  /// Sets the factor (simulated over real time) from the next period on.
  void setFactor(double factor) { factor_ = factor; }
  /// True: simulated time stops while an answer of the PC is late, up to 0.9 s after its last
  /// answer.
  void waitForAnswers(bool waits) { waits_ = waits; }
  /// Sets the PC's port from now on.
  void setPort(std::uint16_t port) { port_ = port; }

  // From any thread
  void setHuman(const plant::PersonInput& human);
  void setMotors(const MotorCommands& motors);
  void setPush(const Wrench& push);
  /// Runs `action` between two periods. The action must own its data: if the thread has begun it
  /// and does not finish in time, it outlives the call. @throws the exception of the action;
  /// std::runtime_error if the thread does not begin it within `limit` s; it is then withdrawn and
  /// never runs.
  void apply(std::function<void(Cell&)> action, double limit = 1.0);
  /// Runs `action` after `delay` simulated seconds.
  void applyLater(double delay, std::function<void(Cell&)> action);

  CellSnapshot snapshot() const;
  double takeLatest();  ///< CellSnapshot::latest since the last call
  /// Simulated seconds between the snapshots that takeSnapshots() returns; forces are means over
  /// this interval. @pre not running
  void setSnapshotInterval(double interval) { interval_ = interval; }
  std::vector<CellSnapshot> takeSnapshots();  ///< since the last call, oldest first, at most 2000
  std::vector<TickRecord> takeRecords();      ///< since the last call
  std::vector<krc::Message> takeMessages();   ///< of the controller, since the last call
  /// Error that ended the thread; empty while it runs.
  std::string failure() const;

 private:
  struct Action {
    std::packaged_task<void(Cell&)> task;
    std::atomic<bool> taken{false};  // by the thread, or withdrawn by the caller
  };
  struct Delayed {
    double time;
    std::function<void(Cell&)> action;
  };
  std::string schedule(int priority) const;
  void run();
  void applyInputs();
  void leaveResults(bool answered, bool expected, bool unanswered, double behind, bool keep);

  Cell cell_;
  FriSocket socket_;
  std::atomic<double> factor_;
  std::atomic<bool> waits_{false};
  std::atomic<std::uint16_t> port_;
  std::atomic<bool> running_{false};
  std::thread thread_;
  double interval_ = 0.005, next_snapshot_ = 0.0;  // simulated, s

  mutable std::mutex mutex_;  // guards everything below
  bool new_human_ = false;
  plant::PersonInput human_;
  MotorCommands motors_{};
  Wrench push_;
  std::vector<std::shared_ptr<Action>> actions_;
  std::vector<Delayed> delayed_;
  CellSnapshot snapshot_;
  std::vector<CellSnapshot> snapshots_;
  std::vector<TickRecord> records_;
  std::vector<krc::Message> messages_;
  std::string failure_;
  std::uint64_t messages_seen_ = 0;
};

}  // namespace coglab_sim
