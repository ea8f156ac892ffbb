/// @file
/// The FRI thread. It has one UDP socket, and runs only Bridge::compute() between receive and send.
/// Threads: docs/architecture.md.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include "lwr_fri_bridge/bridge/bridge.hpp"
#include "lwr_fri_bridge/names.hpp"

namespace lwr_fri_bridge {

struct FriThreadOptions {
  std::string address = "127.0.0.1";  ///< local address to bind; that of the network card towards
                                      ///< the cabinet, 0.0.0.0: all
  int port = fri::kDefaultPort;       ///< local UDP port, 0: any free one
  std::string controller_address;     ///< robot controller; empty: the first sender
  int priority = 80;                  ///< SCHED_FIFO; 0: do not change the scheduling
  std::size_t stack_bytes = 256 * 1024;
  /// Wakes the control thread. Called in the FRI thread after each sent answer, and after each
  /// time-out without datagrams (answered = false). Must be real-time safe.
  std::function<void(bool answered)> after_answer;
};

/// Times from receive to send: exponential mean over about 1000 answers, and the longest. One
/// thread adds, any thread may read. No allocation, no lock.
class AnswerTimes {
 public:
  /// @param taken duration, s
  void add(float taken) noexcept {
    const float mean = mean_.load(std::memory_order_relaxed);
    mean_.store(mean == 0.0F ? taken : mean + 1e-3F * (taken - mean), std::memory_order_relaxed);
    if (taken > longest_.load(std::memory_order_relaxed)) {
      longest_.store(taken, std::memory_order_relaxed);
    }
  }
  double mean() const noexcept { return mean_; }  ///< s; 0: no answer yet
  /// Longest time since the last call with restart = true, s
  double longest(bool restart) noexcept {
    return restart ? longest_.exchange(0.0F) : longest_.load();
  }

 private:
  std::atomic<float> mean_{0.0F}, longest_{0.0F};
};

/// Counters of the thread. Any thread may read them.
struct FriThreadStatistics {
  std::uint64_t answers = 0;
  std::uint64_t superseded = 0;  ///< datagrams skipped because a newer one was waiting
  std::uint64_t foreign = 0;     ///< datagrams from a second sender, ignored
  std::uint64_t send_errors = 0;
  std::string peer;               ///< "address:port" of the robot controller; empty: none
  std::string last_foreign;       ///< "address:port" of the last second sender
  double mean_answer_time = 0.0;  ///< s, receive to send, exponential mean over about 1000 answers
  double longest_answer_time = 0.0;  ///< s, since the last call of statistics(true)
  bool real_time = false;            ///< SCHED_FIFO was granted
};

/// The peer is the first sender of a valid datagram, at `controller_address` if that is set. It
/// receives the answers and stays the peer until it is silent. If several datagrams wait, only the
/// newest is answered; the controller no longer expects answers to the others.
class FriThread {
 public:
  FriThread(Bridge& bridge, FriThreadOptions options);
  ~FriThread();
  FriThread(const FriThread&) = delete;
  FriThread& operator=(const FriThread&) = delete;

  /// Binds the socket and starts the thread. With options.port 0, `preferred_port` is tried first,
  /// so that a restarted node has the same port as before. Returns warnings about scheduling; empty
  /// if there are none.
  /// @throws std::runtime_error with address and port if the socket cannot be bound, or with an
  /// invalid address.
  std::string start(int preferred_port = 0);
  /// Ends the thread at once. The caller must brake and leave command mode before
  /// (Bridge::command("stop")).
  void stop();

  int port() const { return bound_port_; }  ///< bound port
  int priority() const { return options_.priority; }
  const std::string& controllerAddress() const { return options_.controller_address; }
  FriThreadStatistics statistics(bool restart_longest = false);

 private:
  struct Batch;
  void run();
  int receive(Batch& batch);
  bool isController(std::uint64_t endpoint) const;
  void serve(Batch& batch, int received, std::int64_t now_ns);

  Bridge& bridge_;
  FriThreadOptions options_;
  int socket_ = -1;
  std::uint32_t controller_ = 0;      // controller_address, 0: any
  std::uint32_t local_ = 0;           // address bound
  std::int64_t last_receive_ns_ = 0;  // FRI thread
  int bound_port_ = 0;
  BoundedThread thread_;
  std::atomic<bool> stopping_{false};
  std::atomic<int> scheduling_{0};  // 0 unknown, 1 granted, 2 refused, 3 not requested
  std::string scheduling_warning_;  // written before scheduling_
  std::atomic<std::uint64_t> answers_{0}, superseded_{0}, foreign_{0}, send_errors_{0};
  std::atomic<std::uint64_t> peer_{0}, last_foreign_{0};  // address << 16 | port, 0: none
  AnswerTimes answer_times_;
};

}  // namespace lwr_fri_bridge
