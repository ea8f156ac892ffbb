/// @file
/// The cell on a clock: one thread that paces the FRI periods and speaks UDP. No ROS here.
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

/// One FRI period for the log.
struct TickRecord {
  double time = 0.0;  ///< s, simulated, at the end of the period
  int state = 0, quality = 0, power = 0, control = 0;
  bool answered = false;        ///< the last measurement got its answer in time
  Vector7 commanded, measured;  ///< rad
};

/// What the thread leaves for others to look at.
struct CellSnapshot {
  CellTruth truth;
  MotorStates motors;
  plant::Touch touch;
  std::int64_t stepped_ns = 0;   ///< steady clock, when the last physics step was made
  std::uint64_t tick = 0;        ///< number of periods so far
  std::uint64_t late_ticks = 0;  ///< periods that the thread itself began too late
  std::uint64_t answers = 0;     ///< datagrams received so far
  std::uint64_t sent = 0;        ///< measurements that left in time
  std::uint64_t unanswered = 0;  ///< those of them without an answer within their period
  double latest = 0.0;           ///< s, by which the latest period since takeLatest() began late
  /// Why the person's hand was refused; empty: it was not.
  std::string refused_hand;
};

/// Runs a Cell in real time times a factor.
class RealTimeCell {
 public:
  /// @param factor  simulated over real time, 0.01 .. 100
  /// @param source_port  from which the controller sends, 0: any free one
  /// @throws what Cell and FriSocket throw, std::invalid_argument for the factor
  RealTimeCell(const CellConfig& config, const std::string& host, std::uint16_t port, double factor,
               std::uint16_t source_port = 0);
  ~RealTimeCell();
  RealTimeCell(const RealTimeCell&) = delete;
  RealTimeCell& operator=(const RealTimeCell&) = delete;

  /// Starts the thread, named `cell`: a robot controller is a real-time computer of its own, so
  /// that it gets SCHED_FIFO with `priority` (0: none) where that is granted. Faster than real time
  /// it is a normal thread: it would leave nothing to others. Returns an empty string, or why it is
  /// one.
  /// @pre not running
  std::string start(int priority = 0);
  void stop();
  /// Simulated over real time from the next period on.
  void setFactor(double factor) { factor_ = factor; }
  /// Whether simulated time stands while an answer of a PC that answers is late, up to 0.9 s after
  /// the one before.
  void waitForAnswers(bool waits) { waits_ = waits; }
  /// Where the PC listens from now on.
  void setPort(std::uint16_t port) { port_ = port; }

  // From any thread
  void setHuman(const plant::PersonInput& human);
  void setMotors(const MotorCommands& motors);
  void setPush(const Wrench& push);
  /// Runs `action` between two periods. It has to own what it uses: when the thread has begun with
  /// it but does not end it in time, it may outlive the call. @throws what it throws,
  /// std::runtime_error if the thread does not get to it within `limit` s; then it is withdrawn and
  /// never runs.
  void apply(std::function<void(Cell&)> action, double limit = 1.0);
  /// Runs `action` after so many simulated seconds.
  void applyLater(double delay, std::function<void(Cell&)> action);

  CellSnapshot snapshot() const;
  double takeLatest();  ///< CellSnapshot::latest since the last call
  /// Simulated seconds between the snapshots that takeSnapshots() returns; forces are means over
  /// them. @pre not running
  void setSnapshotInterval(double interval) { interval_ = interval; }
  std::vector<CellSnapshot>
  takeSnapshots();                           ///< since the last call, oldest first, of 2000 at most
  std::vector<TickRecord> takeRecords();     ///< since the last call
  std::vector<krc::Message> takeMessages();  ///< of the controller, since the last call
  /// The thread ended by itself with this error; empty while it runs.
  std::string failure() const;

 private:
  struct Action {
    std::packaged_task<void(Cell&)> task;
    std::atomic<bool> taken{false};  // by the thread, or back by the caller
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
