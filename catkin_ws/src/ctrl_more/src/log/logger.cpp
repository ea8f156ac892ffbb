#include "ctrl_more/log/logger.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <mutex>
#include <sstream>
#include <stdexcept>
#include <thread>
#include <vector>

#include "coglab_rt/clock.hpp"

namespace ctrl_more {
namespace {

template <std::size_t N>
void copyText(std::array<char, N>& to, const char* from) {
  std::size_t i = 0;
  for (; i + 1 < N && from[i] != '\0'; ++i) to[i] = from[i];
  to[i] = '\0';
}

const char* withoutFolders(const char* file) {
  const char* slash = std::strrchr(file, '/');
  return slash ? slash + 1 : file;
}

}  // namespace

const char* nameOf(LogLevel level) {
  static const char* const names[] = {"DEBUG", "INFO", "WARN", "ERROR"};
  return names[static_cast<int>(level)];
}

std::string LogRecord::message() const {
  std::string result;
  int used = 0;
  for (const char* c = text.data(); *c != '\0'; ++c) {
    if (c[0] == '{' && c[1] == '}' && used < values) {
      char number[32];
      std::snprintf(number, sizeof number, "%g", value[used++]);
      result += number;
      ++c;
    } else {
      result += *c;
    }
  }
  return result;
}

std::string LogRecord::toLine() const {
  std::ostringstream out;
  out << '[' << nameOf(level) << "] " << source.data();
  if (file[0] != '\0') {
    out << " (" << file.data() << ':' << line;
    if (cycle != 0) out << ", cycle " << cycle;
    out << ')';
  }
  out << ": " << message();
  return out.str();
}

FileLogSink::FileLogSink(const std::string& path) : stream_(path, std::ios::app) {
  if (!stream_) throw std::runtime_error("cannot open log file " + path + " for appending");
}

void FileLogSink::write(const LogRecord& record) {
  stream_ << record.toLine() << '\n' << std::flush;
}

void StreamLogSink::write(const LogRecord& record) { out_ << record.toLine() << '\n'; }

// Bounded queue for many producers. `turn` of a cell is the position for which the cell is ready.
// It shows a producer that the cell is free, and the consumer that its record is complete.
struct Logger::Ring {
  struct Cell {
    std::atomic<std::uint64_t> turn{0};
    LogRecord record;
  };
  explicit Ring(std::size_t capacity) : cells(capacity), mask(capacity - 1) {
    for (std::size_t i = 0; i < capacity; ++i) cells[i].turn.store(i, std::memory_order_relaxed);
  }
  std::vector<Cell> cells;
  std::uint64_t mask;
  std::atomic<std::uint64_t> head{0};
  std::uint64_t tail = 0;  // under Drain::mutex
};

struct Logger::Drain {
  std::mutex mutex;
  std::vector<std::shared_ptr<LogSink>> sinks;
  std::mutex stop_mutex;
  std::condition_variable stop_signal;
  bool stop = false;
  std::thread thread;
};

Logger::Logger(std::size_t capacity) : drain_(std::make_unique<Drain>()) {
  std::size_t size = 2;
  while (size < capacity) size *= 2;
  ring_ = std::make_unique<Ring>(size);
}

Logger::~Logger() {
  if (drain_->thread.joinable()) {
    {
      const std::lock_guard<std::mutex> lock(drain_->stop_mutex);
      drain_->stop = true;
    }
    drain_->stop_signal.notify_all();
    drain_->thread.join();
  }
  drain();
}

Logger& Logger::standard() {
  static Logger logger;
  static const bool started = [] {
    logger.addSink(std::make_shared<StreamLogSink>(std::cerr));
    logger.startDraining();
    return true;
  }();
  static_cast<void>(started);
  return logger;
}

void Logger::addSink(std::shared_ptr<LogSink> sink) {
  const std::lock_guard<std::mutex> lock(drain_->mutex);
  drain_->sinks.push_back(std::move(sink));
}

bool Logger::push(const LogRecord& record) {
  if (!wants(record.level)) return true;
  std::uint64_t position = ring_->head.load(std::memory_order_relaxed);
  while (true) {
    Ring::Cell& cell = ring_->cells[position & ring_->mask];
    const std::uint64_t turn = cell.turn.load(std::memory_order_acquire);
    if (turn == position) {
      if (ring_->head.compare_exchange_weak(position, position + 1, std::memory_order_relaxed)) {
        cell.record = record;
        cell.turn.store(position + 1, std::memory_order_release);
        return true;
      }
    } else if (turn < position) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return false;
    } else {
      position = ring_->head.load(std::memory_order_relaxed);
    }
  }
}

void Logger::log(LogLevel level, const std::string& source, const std::string& text,
                 const char* file, int line) {
  if (!wants(level)) return;
  LogRecord record;
  record.level = level;
  record.time_ns = coglab_rt::steadyNow();
  record.line = line;
  copyText(record.source, source.c_str());
  copyText(record.file, withoutFolders(file));
  copyText(record.text, text.c_str());
  push(record);
}

std::size_t Logger::drain() {
  const std::lock_guard<std::mutex> lock(drain_->mutex);
  std::size_t count = 0;
  while (true) {
    Ring::Cell& cell = ring_->cells[ring_->tail & ring_->mask];
    if (cell.turn.load(std::memory_order_acquire) != ring_->tail + 1) return count;
    const LogRecord record = cell.record;
    cell.turn.store(ring_->tail + ring_->mask + 1, std::memory_order_release);
    ++ring_->tail;
    ++count;
    for (const auto& sink : drain_->sinks) sink->write(record);
  }
}

void Logger::startDraining(int period_ms) {
  if (drain_->thread.joinable()) return;
  drain_->thread = std::thread([this, period_ms] {
    std::unique_lock<std::mutex> lock(drain_->stop_mutex);
    while (!drain_->stop) {
      drain_->stop_signal.wait_for(lock, std::chrono::milliseconds(period_ms));
      lock.unlock();
      drain();
      lock.lock();
    }
  });
}

LogSource::LogSource(Logger* logger, const std::string& name,
                     const std::atomic<std::uint64_t>* cycle)
    : logger_(logger), cycle_(cycle) {
  copyText(name_, name.c_str());
}

void LogSource::put(LogLevel level, const char* file, int line, const char* text,
                    const double* values, int count) const {
  if (!logger_ || !logger_->wants(level)) return;
  LogRecord record;
  record.level = level;
  record.time_ns = coglab_rt::steadyNow();
  record.cycle = cycle_ ? cycle_->load(std::memory_order_relaxed) : 0;
  record.line = line;
  record.values = count;
  for (int i = 0; i < count; ++i) record.value[i] = values[i];
  record.source = name_;
  copyText(record.file, withoutFolders(file));
  copyText(record.text, text);
  logger_->push(record);
}

}  // namespace ctrl_more
