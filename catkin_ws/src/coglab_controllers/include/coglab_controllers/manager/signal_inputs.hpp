/// @file
/// Robot signals from messages: checks each message and passes its numbers to the control cycle.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "coglab_controllers/manager/signal_file.hpp"
#include "ctrl_more/states/robot_states.hpp"
#include "ctrl_more/states/signal_mailbox.hpp"
#include "ctrl_more/states/status.hpp"

namespace coglab_controllers {

/// View of a message for the rows. It refers to the memory of the message.
struct SignalMessage {
  struct Field {
    const double* numbers = nullptr;
    std::size_t size = 0;  ///< 0: the message does not have this field
  };
  std::int64_t stamp_ns = 0;             ///< steady clock; 0: no stamp
  std::string frame;                     ///< frame_id of the header
  std::vector<Field> fields;             ///< in the order of SignalType::fields
  std::vector<std::string> joint_names;  ///< of a JointState
};

/// Why a message was refused.
enum class SignalRefusal : std::uint8_t {
  None,
  Frame,      ///< another frame_id
  Missing,    ///< a field, joint or index is missing
  Size,       ///< number of doubles differs from that of the row
  NotFinite,  ///< NaN or infinity
  NoStamp,    ///< header without a stamp
  Past,       ///< older than the largest age, or not newer than the previous message
  Future,     ///< ahead of the clock
};

/// Result of SignalInputs::post().
struct SignalPost {
  SignalRefusal refusal = SignalRefusal::None;
  std::string text;  ///< one sentence about the refusal
};

/// The rows of `in` with a mailbox for each.
///
/// Threads: add() before the first cycle. post(): one thread at a time for each row. deliver(): the
/// cycle, wait-free. newestStamp(): any thread.
class SignalInputs {
 public:
  /// Adds rows and declares their signals, all or nothing.
  /// @return failure if a signal has another writer already
  ctrl_more::Status add(const std::vector<SignalInput>& rows, ctrl_more::RobotStates& robot);

  /// Removes all rows after the first ones; before the first cycle. Their signals stay absent.
  void keepFirst(std::size_t rows) {
    while (rows_.size() > rows) rows_.pop_back(), boxes_.pop_back();
  }

  /// All rows, in the order in which they were added.
  const std::deque<SignalInput>& rows() const { return rows_; }

  /// Passes the numbers of one row on to the cycle. A refused message changes nothing.
  /// @param row index in rows()
  /// @param message of the row's type
  /// @param now_ns current time on the clock of the stamps
  SignalPost post(std::size_t row, const SignalMessage& message, std::int64_t now_ns);

  /// Stamp (ns) of the newest accepted message of a row; ctrl_more::kNeverWritten: none yet.
  std::int64_t newestStamp(std::size_t row) const {
    return boxes_[row].newest.load(std::memory_order_relaxed);
  }

  /// Writes the newest values into the robot states. Signals with too old values become absent.
  void deliver(ctrl_more::RobotStates& robot, std::int64_t now_ns) noexcept {
    for (Box& box : boxes_) box.mailbox.deliver(robot, now_ns);
  }

 private:
  struct Box {
    Box(const SignalInput& row, ctrl_more::RobotSignal signal);
    ctrl_more::SignalMailbox mailbox;
    std::vector<double> values;  // of post()
    std::atomic<std::int64_t> newest{ctrl_more::kNeverWritten};
  };

  std::deque<SignalInput> rows_;
  std::deque<Box> boxes_;  // one for each row
};

}  // namespace coglab_controllers
