#pragma once

#include <cstdint>
#include <string>
#include <utility>

namespace ctrl_more {

/// Kind of the failure of a Status, for programs. The sentence of the Status is for users.
enum class Cause : std::uint8_t {
  None,             ///< success
  InvalidArgument,  ///< a value, size, name or combination that is not allowed
  UnknownName,      ///< no controller, gain, setting, signal or profile of that name
  Busy,             ///< another action must end or be undone first
  BadFile,          ///< a file was not read; the sentence names it
  Fault             ///< the controller's own code threw
};

/// Outcome of a request made outside the control cycle.
///
/// A success has no text and allocates nothing. A failure has one sentence for the user: the
/// expected and the actual value, and what to do next.
class Status {
 public:
  /// Success.
  Status() = default;

  /// Success of a request that published a plan. The caller can wait for its `generation`.
  /// @param generation plan number, see FeedbackControllersManager::waitAdopted()
  static Status published(std::uint64_t generation) {
    Status status;
    status.generation_ = generation;
    return status;
  }

  /// Failure with its sentence.
  /// @param message expected and actual value, and what to do next; must not be empty
  /// @param cause kind of the failure
  static Status failure(std::string message, Cause cause = Cause::InvalidArgument) {
    Status status;
    status.cause_ = cause;
    status.message_ = std::move(message);
    return status;
  }

  /// True for success.
  bool ok() const { return cause_ == Cause::None; }

  /// True for success.
  explicit operator bool() const { return ok(); }

  /// Kind of the failure; None for a success.
  Cause cause() const { return cause_; }

  /// The sentence of a failure. For a success: empty, or a note, such as the controllers that a
  /// request skipped.
  const std::string& message() const { return message_; }

  /// Adds a note to a success.
  /// @param text one sentence
  /// @return this status
  Status& note(std::string text) {
    message_ = std::move(text);
    return *this;
  }

  /// Number of the plan that this request published; 0 if none.
  std::uint64_t generation() const { return generation_; }

 private:
  Cause cause_ = Cause::None;
  std::uint64_t generation_ = 0;
  std::string message_;
};

}  // namespace ctrl_more
