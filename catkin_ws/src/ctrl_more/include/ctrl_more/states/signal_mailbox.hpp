#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "ctrl_more/states/robot_states.hpp"

namespace ctrl_more {

/// Carries one robot signal from another thread (a driver, a subscriber) into the control cycle.
/// Three buffers: the writer always has a free one, the cycle always finds the newest complete
/// one, and neither waits for the other. One writer, one reader.
class SignalMailbox {
 public:
  /// @param signal handle from RobotStates::find()
  explicit SignalMailbox(RobotSignal signal) : signal_(signal) {
    for (auto& letter : letters_) letter.values.assign(signal.size(), 0.0);
  }

  /// Leaves new values (writer's thread). No allocation.
  /// @param values `size` doubles
  /// @param size must be the signal's size
  /// @param stamp_ns monotonic nanoseconds
  /// @return false if the size is wrong
  bool post(const double* values, int size, std::int64_t stamp_ns) {
    if (size != signal_.size()) return false;
    Letter& letter = letters_[writing_];
    for (int i = 0; i < size; ++i) letter.values[i] = values[i];
    letter.stamp_ns = stamp_ns;
    writing_ = middle_.exchange(writing_ | kNew, std::memory_order_acq_rel) & kIndex;
    return true;
  }

  /// Takes the newest values into the robot states (the cycle, at its start).
  /// @return true if there were new ones and they were finite
  bool deliver(RobotStates& robot) {
    if ((middle_.load(std::memory_order_relaxed) & kNew) == 0) return false;
    reading_ = middle_.exchange(reading_, std::memory_order_acq_rel) & kIndex;
    return robot.write(signal_, letters_[reading_].values.data(), letters_[reading_].stamp_ns);
  }

 private:
  static constexpr unsigned kNew = 4;
  static constexpr unsigned kIndex = 3;
  struct Letter {
    std::vector<double> values;
    std::int64_t stamp_ns = kNeverWritten;
  };
  RobotSignal signal_;
  std::array<Letter, 3> letters_;
  unsigned writing_ = 0;
  unsigned reading_ = 1;
  std::atomic<unsigned> middle_{2};
};

}  // namespace ctrl_more
