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

/// One record of fixed size. Texts are copied and cut to fit. Numbers are formatted when the record
/// is drained.
struct LogRecord {
  LogLevel level = LogLevel::Info;  ///< severity
  std::int64_t time_ns = 0;         ///< steady clock [ns]
  std::uint64_t cycle = 0;          ///< control cycle; 0: outside the cycle
  int line = 0;                     ///< source line
  int values = 0;                   ///< number of used elements of `value`
  std::array<double, 4> value{};    ///< numbers that replace each {} of the text
  std::array<char, 48> source{};    ///< controller or module
  std::array<char, 48> file{};      ///< source file, without folders
  std::array<char, 208> text{};     ///< message with {} for each number

  /// The message with its numbers inserted.
  std::string message() const;
  /// `[WARN] attitude (attitude.cpp:41, cycle 17): message`.
  std::string toLine() const;
};

/// Destination of drained records. Called by one thread at a time, never in the cycle.
class LogSink {
 public:
  virtual ~LogSink() = default;
  /// Writes one record.
  virtual void write(const LogRecord& record) = 0;
};

/// Writes records as lines to a file.
class FileLogSink : public LogSink {
 public:
  /// Opens the file for appending. Throws std::runtime_error with the path if that fails.
  /// @param path path of the file
  explicit FileLogSink(const std::string& path);
  void write(const LogRecord& record) override;

 private:
  std::ofstream stream_;
};

/// Writes records as lines to a stream, which must outlive the sink.
class StreamLogSink : public LogSink {
 public:
  /// @param out for example std::cerr
  explicit StreamLogSink(std::ostream& out) : out_(out) {}
  void write(const LogRecord& record) override;

 private:
  std::ostream& out_;
};

/// Logger of Ctrl-MORE (paper, section III-B). Any thread, including the control cycle, writes
/// fixed-size records into a bounded lock-free ring. A thread that may block drains them into
/// sinks. If the ring is full, the newest record is dropped and counted.
class Logger {
 public:
  /// A logger without sinks.
  /// @param capacity number of records in the ring; rounded up to a power of two
  explicit Logger(std::size_t capacity = 1024);
  ~Logger();
  Logger(const Logger&) = delete;
  Logger& operator=(const Logger&) = delete;

  /// Default logger. It writes to std::cerr from a separate thread, which starts at the first use.
  static Logger& standard();

  /// Adds a sink (outside the cycle).
  void addSink(std::shared_ptr<LogSink> sink);

  /// Sets the level below which records are dropped at the source. Default: Info.
  void setLevel(LogLevel level) { level_.store(level, std::memory_order_relaxed); }

  /// True if a record of this level is kept.
  bool wants(LogLevel level) const { return level >= level_.load(std::memory_order_relaxed); }

  /// Writes one record into the ring. No allocation, no lock, no system call.
  /// @return false if the ring was full
  bool push(const LogRecord& record);

  /// Logs a text of any length, cut to the record (outside the cycle).
  void log(LogLevel level, const std::string& source, const std::string& text,
           const char* file = "", int line = 0);

  /// Writes all waiting records to the sinks (outside the cycle).
  /// @return number of records
  std::size_t drain();

  /// Starts a thread that drains every `period_ms`. The destructor stops it.
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

/// Source of records: a logger, a name, and the cycle counter for its records.
class LogSource {
 public:
  /// A source without logger; it drops all records.
  LogSource() = default;
  /// @param logger destination; must outlive the source
  /// @param name controller or module
  /// @param cycle cycle counter for the records; may be null
  LogSource(Logger* logger, const std::string& name,
            const std::atomic<std::uint64_t>* cycle = nullptr);

  /// Writes a record with up to four numbers into the ring. Safe in the cycle.
  /// @param level severity
  /// @param file source file (__FILE__)
  /// @param line source line (__LINE__)
  /// @param text message; each {} stands for one number
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

/// Limits the records of one place in the code to one per period.
class LogThrottle {
 public:
  /// @param period_ns smallest time between two records [ns]
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
