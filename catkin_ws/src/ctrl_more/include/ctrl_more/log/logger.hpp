#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <fstream>
#include <memory>
#include <ostream>
#include <string>

namespace ctrl_more {

/// Severity of a record.
enum class LogLevel : std::uint8_t { Debug, Info, Warning, Error };

/// `DEBUG`, `INFO`, `WARN` or `ERROR`.
const char* nameOf(LogLevel level);

/// One record, of fixed size: texts are copied and cut, numbers are formatted when it is drained.
struct LogRecord {
  LogLevel level = LogLevel::Info;  ///< severity
  std::int64_t time_ns = 0;         ///< steady clock [ns]
  std::uint64_t cycle = 0;          ///< control cycle, 0 outside the cycle
  int line = 0;                     ///< source line
  int values = 0;                   ///< how many of `value` are used
  std::array<double, 4> value{};    ///< numbers, put where the text says {}
  std::array<char, 48> source{};    ///< controller or module
  std::array<char, 48> file{};      ///< source file, without folders
  std::array<char, 208> text{};     ///< message with {} for each number

  /// The message with its numbers put in.
  std::string message() const;
  /// `[WARN] attitude (attitude.cpp:41, cycle 17): message`.
  std::string toLine() const;
};

/// Where drained records go. Called by one thread at a time, never in the cycle.
class LogSink {
 public:
  virtual ~LogSink() = default;
  /// Takes one record.
  virtual void write(const LogRecord& record) = 0;
};

/// Writes records as lines to a file.
class FileLogSink : public LogSink {
 public:
  /// Opens the file for appending; throws std::runtime_error naming the path if it cannot.
  /// @param path the file itself, as given
  explicit FileLogSink(const std::string& path);
  void write(const LogRecord& record) override;

 private:
  std::ofstream stream_;
};

/// Writes records as lines to a stream that outlives it.
class StreamLogSink : public LogSink {
 public:
  /// @param out for example std::cerr
  explicit StreamLogSink(std::ostream& out) : out_(out) {}
  void write(const LogRecord& record) override;

 private:
  std::ostream& out_;
};

/// Logger of Ctrl-MORE (paper, section III-B): any thread, the control cycle included, puts
/// fixed-size records into a bounded lock-free ring; a thread that may block drains them into
/// sinks. A full ring drops the newest record and counts it.
class Logger {
 public:
  /// A logger without sinks.
  /// @param capacity number of records the ring holds; rounded up to a power of two
  explicit Logger(std::size_t capacity = 1024);
  ~Logger();
  Logger(const Logger&) = delete;
  Logger& operator=(const Logger&) = delete;

  /// The logger of programs that do not bring their own: writes to std::cerr from a thread of its
  /// own that starts with the first use.
  static Logger& standard();

  /// Adds a sink (outside the cycle).
  void addSink(std::shared_ptr<LogSink> sink);

  /// Records below this level are dropped at the source. Default Info.
  void setLevel(LogLevel level) { level_.store(level, std::memory_order_relaxed); }

  /// True if a record of this level would be kept.
  bool wants(LogLevel level) const { return level >= level_.load(std::memory_order_relaxed); }

  /// Puts one record in the ring: no allocation, no lock, no system call.
  /// @return false if the ring was full
  bool push(const LogRecord& record);

  /// Convenience for outside the cycle: text of any length (cut to the record).
  void log(LogLevel level, const std::string& source, const std::string& text,
           const char* file = "", int line = 0);

  /// Hands all waiting records to the sinks (outside the cycle).
  /// @return number of records
  std::size_t drain();

  /// Starts a thread that drains every `period_ms`; stopped by the destructor.
  void startDraining(int period_ms = 50);

  /// Number of records dropped because the ring was full.
  std::uint64_t dropped() const { return dropped_.load(std::memory_order_relaxed); }

 private:
  struct Ring;
  struct Drain;
  std::unique_ptr<Ring> ring_;
  std::unique_ptr<Drain> drain_;
  std::atomic<LogLevel> level_{LogLevel::Info};
  std::atomic<std::uint64_t> dropped_{0};
};

/// Who logs: a logger, a name, and the cycle counter that its records carry.
class LogSource {
 public:
  /// Logs nowhere.
  LogSource() = default;
  /// @param logger destination; must outlive the source
  /// @param name controller or module
  /// @param cycle counter to stamp records with, may be null
  LogSource(Logger* logger, const std::string& name,
            const std::atomic<std::uint64_t>* cycle = nullptr);

  /// Puts a record with up to four numbers in the ring. Safe in the cycle.
  /// @param level severity
  /// @param file source file (__FILE__)
  /// @param line source line (__LINE__)
  /// @param text message; each {} takes one number
  /// @param value the numbers
  template <typename... Numbers>
  void write(LogLevel level, const char* file, int line, const char* text, Numbers... value) const {
    static_assert(sizeof...(Numbers) <= 4, "a record holds four numbers");
    const double values[5] = {static_cast<double>(value)..., 0.0};
    put(level, file, line, text, values, static_cast<int>(sizeof...(Numbers)));
  }

 private:
  void put(LogLevel level, const char* file, int line, const char* text, const double* values,
           int count) const;

  Logger* logger_ = nullptr;
  std::array<char, 48> name_{};
  const std::atomic<std::uint64_t>* cycle_ = nullptr;
};

/// Lets through at most one record per period at one place in the code.
class LogThrottle {
 public:
  /// @param period_ns smallest distance of two records [ns]
  explicit LogThrottle(std::int64_t period_ns) : period_ns_(period_ns) {}
  /// True if a record may be written at this time (steady clock) [ns].
  bool pass(std::int64_t now_ns) {
    if (last_ns_ != kNever && now_ns - last_ns_ < period_ns_) return false;
    last_ns_ = now_ns;
    return true;
  }

 private:
  static constexpr std::int64_t kNever = INT64_MIN;
  std::int64_t period_ns_;
  std::int64_t last_ns_ = kNever;
};

}  // namespace ctrl_more

/// Logs from a controller: CTRL_MORE_LOG(log(), Warning, "force {} N too large", force).
#define CTRL_MORE_LOG(source, level, ...) \
  (source).write(::ctrl_more::LogLevel::level, __FILE__, __LINE__, __VA_ARGS__)
