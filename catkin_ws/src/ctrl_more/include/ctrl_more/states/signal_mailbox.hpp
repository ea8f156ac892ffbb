#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "coglab_rt/triple_buffer.hpp"
#include "ctrl_more/states/robot_states.hpp"

namespace ctrl_more {

/// Transfers one robot signal from another thread (a driver, a subscriber) into the control cycle.
/// The cycle reads the newest complete values. Values older than the largest age make the signal
/// absent. Neither side waits for the other. One writer, one reader.
class SignalMailbox {
 public:
  /// @param signal handle from RobotStates::find()
  /// @param max_age_ns largest age of the values
  explicit SignalMailbox(RobotSignal signal, std::int64_t max_age_ns = INT64_MAX)
      : signal_(signal),
        max_age_ns_(max_age_ns),
        letters_({std::vector<double>(signal.size()), kNeverWritten}) {}

  /// Publishes new values (writer's thread). No allocation.
  /// @param values `size` doubles
  /// @param size must be the signal's size
  /// @param stamp_ns monotonic nanoseconds
  /// @return false if the size is wrong
  bool post(const double* values, int size, std::int64_t stamp_ns) {
    if (size != signal_.size()) return false;
    std::copy_n(values, size, letters_.back().values.data());
    letters_.back().stamp_ns = stamp_ns;
    letters_.publish();
    return true;
  }

  /// Copies the newest values into the robot states (at the start of the cycle), or makes the
  /// signal absent if they are too old.
  /// @param now_ns time of the cycle, monotonic nanoseconds
  /// @return true if there were new, finite values
  bool deliver(RobotStates& robot, std::int64_t now_ns = 0) {
    const bool written = letters_.take() && robot.write(signal_, letters_.front().values.data(),
                                                        letters_.front().stamp_ns);
    if (now_ns - robot.stamp(signal_) > max_age_ns_) robot.forget(signal_);
    return written;
  }

 private:
  struct Letter {
    std::vector<double> values;
    std::int64_t stamp_ns;
  };
  RobotSignal signal_;
  std::int64_t max_age_ns_;
  coglab_rt::TripleBuffer<Letter> letters_;
};

}  // namespace ctrl_more
