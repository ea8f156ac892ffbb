#pragma once

#include <cstdint>
#include <string>
#include <utility>

namespace ctrl_more {

/// Outcome of a request made outside the control cycle.
///
/// A success carries no text and allocates nothing. A failure carries one sentence that says what
/// was expected, what came and what to do next, ready to be shown to the user as it is.
class Status {
 public:
  /// Success.
  Status() = default;

  /// Success of a request that published a plan; `generation` is what to wait for.
  /// @param generation plan number, see FeedbackControllersManager::waitAdopted()
  static Status published(std::uint64_t generation) {
    Status status;
    status.generation_ = generation;
    return status;
  }

  /// Failure with its sentence.
  /// @param message expected, got, and what to do next; must not be empty
  static Status failure(std::string message) {
    Status status;
    status.ok_ = false;
    status.message_ = std::move(message);
    return status;
  }

  /// True for success.
  bool ok() const { return ok_; }

  /// True for success.
  explicit operator bool() const { return ok_; }

  /// The sentence of a failure; for a success empty, or a note (for example which controllers a
  /// request left alone).
  const std::string& message() const { return message_; }

  /// Adds a note to a success.
  /// @param text one sentence
  /// @return this status
  Status& note(std::string text) {
    message_ = std::move(text);
    return *this;
  }

  /// Number of the plan this request published; 0 when it published none.
  std::uint64_t generation() const { return generation_; }

 private:
  bool ok_ = true;
  std::uint64_t generation_ = 0;
  std::string message_;
};

}  // namespace ctrl_more
