#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "ctrl_more/states/handles.hpp"
#include "ctrl_more/states/signal.hpp"
#include "ctrl_more/states/signal_table.hpp"
#include "ctrl_more/states/status.hpp"

namespace ctrl_more {

/// Measurements of the robot and estimates of other modules (Ctrl-MORE paper, section IV-A).
///
/// The paper's four maps are `measuredData` with `measurementTimeStamp` and `estimatedData` with
/// `estimateTimeStamp`. Here they are one SignalTable with a stamp for each row. Outside the cycle,
/// users read and write by key. Inside it, controllers and the host use handles. Stamps are
/// monotonic nanoseconds. A declared signal that was never written has the stamp kNeverWritten and
/// contains zeros.
///
/// Threads: one thread at a time. SignalMailbox transfers data from other threads.
class RobotStates {
 public:
  /// An empty store.
  /// @param logger logs new keys and wrong accesses; null: Logger::standard()
  explicit RobotStates(Logger* logger = nullptr);

  /// @name Declaring keys (outside the cycle, before freeze())
  /// @{

  /// Declares a signal, or adds unit and frame to an existing signal of the same size.
  /// @param source map of the signal
  /// @param key name, not empty
  /// @param size number of doubles, > 0
  /// @param unit SI unit or list of units
  /// @param frame frame of the numbers
  Status declare(RobotSource source, const std::string& key, int size, const std::string& unit = "",
                 const std::string& frame = "");

  /// Forbids new keys from now on. Called by the manager before the first cycle.
  void freeze() { table_.freeze(); }

  /// True after freeze().
  bool frozen() const { return table_.frozen(); }
  /// @}

  /// @name The paper's accessors, by key (outside the cycle)
  /// Errors contain the key, the expected and the given size, and the caller.
  /// @{

  using Values = Eigen::Ref<const Eigen::VectorXd>;

  /// Writes `measuredData[key]` and its stamp. A new key is added and logged.
  /// @param key name of the signal
  /// @param value all of its numbers, finite
  /// @param stamp_ns time of measurement, monotonic nanoseconds >= 0
  /// @param who name of the writer for messages
  Status setMeasuredData(const std::string& key, const Values& value, std::int64_t stamp_ns,
                         const char* who = "user") {
    return set(RobotSource::Measured, key, value, stamp_ns, who);
  }
  /// As setMeasuredData(), in `estimatedData`.
  Status setEstimatedData(const std::string& key, const Values& value, std::int64_t stamp_ns,
                          const char* who = "user") {
    return set(RobotSource::Estimated, key, value, stamp_ns, who);
  }
  /// Reads `measuredData[key]`. On failure `value` is unchanged.
  Status getMeasuredData(const std::string& key, Eigen::VectorXd& value,
                         const char* who = "user") const {
    return get(RobotSource::Measured, key, value, nullptr, who);
  }
  /// Reads `measuredData[key]` with its stamp. On failure both are unchanged.
  Status getMeasuredData(const std::string& key, Eigen::VectorXd& value, std::int64_t& stamp_ns,
                         const char* who = "user") const {
    return get(RobotSource::Measured, key, value, &stamp_ns, who);
  }
  /// As getMeasuredData(), from `estimatedData`.
  Status getEstimatedData(const std::string& key, Eigen::VectorXd& value,
                          const char* who = "user") const {
    return get(RobotSource::Estimated, key, value, nullptr, who);
  }
  /// As getMeasuredData(), from `estimatedData`.
  Status getEstimatedData(const std::string& key, Eigen::VectorXd& value, std::int64_t& stamp_ns,
                          const char* who = "user") const {
    return get(RobotSource::Estimated, key, value, &stamp_ns, who);
  }
  /// Writes `measurementTimeStamp[key]`. Refused if `measuredData` has no such key.
  Status setMeasurementTimeStamp(const std::string& key, std::int64_t stamp_ns,
                                 const char* who = "user") {
    return setStamp(RobotSource::Measured, key, stamp_ns, who);
  }
  /// Writes `estimateTimeStamp[key]`. Refused if `estimatedData` has no such key.
  Status setEstimateTimeStamp(const std::string& key, std::int64_t stamp_ns,
                              const char* who = "user") {
    return setStamp(RobotSource::Estimated, key, stamp_ns, who);
  }
  /// @}

  /// @name Access by handle (inside the cycle: no allocation, no lock)
  /// @{

  /// Handle of a key; invalid if the key does not exist (outside the cycle).
  RobotSignal find(RobotSource source, const std::string& key) const;

  /// The numbers of a signal.
  Eigen::Map<const Eigen::VectorXd> view(RobotSignal signal) const {
    return Eigen::Map<const Eigen::VectorXd>(table_.data().data() + signal.offset(), signal.size());
  }

  /// The numbers of a signal whose size was checked when its handle was made.
  /// @throws EmptyHandle
  template <int N>
  Eigen::Map<const Eigen::Matrix<double, N, 1>> view(const Read<N>& handle) const {
    if (!handle.valid()) throw EmptyHandle("a robot signal is read that was never fetched");
    return Eigen::Map<const Eigen::Matrix<double, N, 1>>(
        table_.data().data() + handle.signal_.offset(), handle.size());
  }

  /// Stamp of a signal, monotonic nanoseconds, or kNeverWritten.
  template <int N>
  std::int64_t stamp(const Read<N>& handle) const {
    return stamps_[handle.signal_.index()];
  }

  /// Stamp of a signal, monotonic nanoseconds, or kNeverWritten.
  std::int64_t stamp(RobotSignal signal) const { return stamps_[signal.index()]; }

  /// Largest time that a stamp may be ahead of now [ns], because sensors and the cycle read the
  /// clock at different moments. A later stamp comes from another clock and is not fresh.
  static constexpr std::int64_t kMostAhead = 50'000'000;

  /// True if the stamp is at most `max_age_ns` before `now_ns` and at most kMostAhead after it.
  bool isFresh(RobotSignal signal, std::int64_t now_ns, std::int64_t max_age_ns) const {
    const std::int64_t stamp = stamps_[signal.index()];
    // Too far ahead becomes a number larger than any age.
    const auto age = static_cast<std::uint64_t>(now_ns - stamp + kMostAhead);
    return stamp != kNeverWritten && age <= static_cast<std::uint64_t>(max_age_ns) + kMostAhead;
  }

  /// Writes a signal. If a number is not finite, returns false and leaves the signal unchanged.
  /// @param signal handle from find()
  /// @param values `signal.size()` doubles
  /// @param stamp_ns monotonic nanoseconds >= 0
  bool write(RobotSignal signal, const double* values, std::int64_t stamp_ns);

  /// Makes a signal absent, as if it was never written. Controllers that need it wait for it.
  void forget(RobotSignal signal) { stamps_[signal.index()] = kNeverWritten; }
  /// @}

  /// Newest stamp of all signals; kNeverWritten if none was written. A manager without a clock uses
  /// it as the current time.
  std::int64_t newestStamp() const { return newest_; }

  /// Signals of one map, in order of declaration.
  std::vector<SignalInfo> signals(RobotSource source) const;

  /// Prints every signal of both maps with its numbers, unit and age.
  /// @param out stream
  /// @param now_ns reference time of the ages; kNeverWritten: newestStamp()
  void print(std::ostream& out, std::int64_t now_ns = kNeverWritten) const;

 private:
  Status set(RobotSource source, const std::string& key, const Values& value, std::int64_t stamp_ns,
             const char* who);
  Status get(RobotSource source, const std::string& key, Eigen::VectorXd& value,
             std::int64_t* stamp_ns, const char* who) const;
  Status setStamp(RobotSource source, const std::string& key, std::int64_t stamp_ns,
                  const char* who);
  void stampSignal(std::uint32_t index, std::int64_t stamp_ns);

  SignalTable table_;
  std::vector<std::int64_t> stamps_;  // one for each row
  std::int64_t newest_ = kNeverWritten;
};

}  // namespace ctrl_more
