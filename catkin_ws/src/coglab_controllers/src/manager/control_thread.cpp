#include "coglab_controllers/manager/control_thread.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <stdexcept>
#include <utility>

namespace coglab_controllers {

namespace {

timespec after(double seconds) {
  timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  const std::int64_t ns = time.tv_nsec + static_cast<std::int64_t>(seconds * 1e9);
  time.tv_sec += ns / 1000000000;
  time.tv_nsec = ns % 1000000000;
  return time;
}

}  // namespace

ControlThread::ControlThread(ControlCycle& cycle, coglab_rt::ArmMailboxes& mailboxes,
                             ControlThreadOptions options)
    : cycle_(cycle), mailboxes_(mailboxes), options_(std::move(options)) {
  if (sem_init(&semaphore_, 0, 0) != 0) throw std::runtime_error("sem_init failed");
}

ControlThread::~ControlThread() {
  stop();
  sem_destroy(&semaphore_);
}

void ControlThread::start() {
  stopping_ = false;
  thread_.start("control", options_.stack_bytes, [this] { run(); });
}

void ControlThread::stop() {
  if (!thread_.running()) return;
  stopping_ = true;
  sem_post(&semaphore_);
  thread_.join();
}

void ControlThread::wake(bool answered) noexcept {
  if (!answered) return;  // without measurements the time-out of the thread runs idle cycles
  if (++since_wake_ < periods_.load(std::memory_order_relaxed)) return;
  since_wake_ = 0;
  int waiting = 0;
  if (sem_getvalue(&semaphore_, &waiting) == 0 && waiting > 0) return;  // it has not run since
  sem_post(&semaphore_);
}

std::string ControlThread::warning() const {
  return scheduled_.load(std::memory_order_acquire) ? warning_ : std::string();
}

void ControlThread::run() {
  if (options_.priority > 0) warning_ = coglab_rt::enterRealTime(options_.priority);
  scheduled_.store(true, std::memory_order_release);
  while (!stopping_.load(std::memory_order_relaxed)) {
    const timespec end = after(options_.idle_period);
    const bool woken = sem_clockwait(&semaphore_, CLOCK_MONOTONIC, &end) == 0;
    if (!stopping_.load(std::memory_order_relaxed)) once(woken);
  }
}

void ControlThread::once(bool woken) {
  RobotSample sample;
  mailboxes_.newestSample(sample);
  const std::uint64_t passed = sample.sequence - last_sequence_;
  const int periods = periods_.load(std::memory_order_relaxed);
  const bool due = passed > 0 && (woken || passed >= static_cast<std::uint64_t>(periods));
  if (sample.sequence == 0 || !due) {
    if (!woken) cycle_.idle(steadyNow());
    return;
  }
  const double target = cycle_.settings().cycle_time;
  const double period = sample.cycle_time > 0.0 ? sample.cycle_time : target;
  periods_.store(std::max(1, static_cast<int>(std::ceil(target / period - 1e-6))),
                 std::memory_order_relaxed);
  // From the controller's counter, because the arm moves while measurements are lost. The first
  // measurement counts as one cycle.
  const double passed_time = 1e-9 * static_cast<double>(sample.controller_ns - last_controller_ns_);
  const double dt = last_sequence_ == 0 ? target : passed_time;
  last_sequence_ = sample.sequence;
  last_controller_ns_ = sample.controller_ns;
  VelocityCommand command;
  cycle_.run(sample, std::min(dt, cycle_.settings().sample_timeout), command);
  mailboxes_.sendVelocity(command);
  if (options_.after_cycle) options_.after_cycle(command);
}

}  // namespace coglab_controllers
