#include "coglab_sim/real_time_cell.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <pthread.h>

#include "coglab_rt/clock.hpp"
#include "coglab_rt/real_time.hpp"
#include "coglab_sim/ranges.hpp"

namespace coglab_sim {
namespace {

using Clock = std::chrono::steady_clock;

// After a measurement later than this share of a period, a missing answer does not count against
// the PC.
constexpr double kLateShare = 0.2;
// Number of late periods after which the schedule restarts instead of catching up.
constexpr int kGiveUp = 5;
constexpr double kPatience = 0.9;  // s, longest time between two answers while the cell waits
constexpr std::size_t kMaxRecords = 100000, kMaxSnapshots = 2000;  // kept if they are not taken

}  // namespace

RealTimeCell::RealTimeCell(const CellConfig& config, const std::string& host, std::uint16_t port,
                           double factor, std::uint16_t source_port)
    : cell_(config), socket_(host, source_port), factor_(factor), port_(port) {
  requireWithin("speed", factor);
}

RealTimeCell::~RealTimeCell() { stop(); }

std::string RealTimeCell::start(int priority) {
  if (running_.exchange(true)) throw std::logic_error("the simulated cell runs already");
  std::promise<std::string> scheduled;
  std::future<std::string> scheduling = scheduled.get_future();
  thread_ = std::thread([this, priority, scheduled = std::move(scheduled)]() mutable {
    try {
      scheduled.set_value(schedule(priority));
      run();
    } catch (const std::exception& error) {
      const std::lock_guard<std::mutex> lock(mutex_);
      failure_ = error.what();
    }
  });
  return scheduling.get();
}

std::string RealTimeCell::schedule(int priority) const {
  pthread_setname_np(pthread_self(), "cell");
  if (priority == 0) return "no priority was asked for";
  if (factor_ > 1.0) return "it runs faster than real time";
  return coglab_rt::enterRealTime(priority);
}

void RealTimeCell::stop() {
  running_ = false;
  if (thread_.joinable()) thread_.join();
}

void RealTimeCell::run() {
  const auto periodNow = [this] {
    return std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(cell_.period() / factor_));
  };
  auto period = periodNow();
  auto deadline = Clock::now();
  auto sent_at = deadline, answered_at = deadline - std::chrono::hours(1);
  bool sent_late = false, answered = false, kept = true;
  std::array<std::uint8_t, 2048> buffer{};
  while (running_) {
    answered = false;
    const auto listenUntil = [&](Clock::time_point until, bool for_one) {
      for (;;) {
        const long size = socket_.receive(buffer.data(), buffer.size(), until);
        if (size < 0) return;
        const double latency =
            std::chrono::duration<double>(Clock::now() - sent_at).count() * factor_;
        cell_.receive(buffer.data(), static_cast<std::size_t>(size), latency);
        answered = true;
        answered_at = Clock::now();
        // A flood of datagrams must not stop the clock.
        if (for_one || Clock::now() >= until) return;
      }
    };
    listenUntil(deadline, false);
    const bool expected = cell_.sent() && !sent_late;  // expects an answer within this period
    const bool unanswered = expected && !answered;
    // The PC answers, but late because this computer is busy: simulated time waits for the answer.
    if (waits_ && cell_.sent() && !answered)
      listenUntil(answered_at + std::chrono::duration_cast<Clock::duration>(
                                    std::chrono::duration<double>(kPatience)),
                  true);
    const auto now = Clock::now();
    const double behind = std::chrono::duration<double>(now - deadline).count();
    const bool late =
        now - deadline > std::chrono::duration_cast<Clock::duration>(period * kLateShare);

    applyInputs();
    cell_.advance(!sent_late, kept);
    sent_at = Clock::now();
    if (cell_.sent()) socket_.send(cell_.measurement().data(), cell_.measurement().size(), port_);
    sent_late = late;
    period = periodNow();  // the KRL program may have reopened FRI
    const double time = cell_.controller().time();
    kept = time > next_snapshot_ - 1e-9;
    if (kept) next_snapshot_ = std::max(next_snapshot_, time - cell_.period()) + interval_;
    leaveResults(answered, expected, unanswered, late ? behind : 0.0, kept);
    deadline += period;
    // If simulated time may wait, it catches up at most one period.
    if (now - deadline > (waits_ ? 1 : kGiveUp) * period) deadline = now + period;
  }
}

void RealTimeCell::applyInputs() {
  std::vector<std::shared_ptr<Action>> actions;
  std::vector<Delayed> due;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (new_human_) {
      try {
        cell_.setHuman(human_);
        snapshot_.refused_hand.clear();
      } catch (const std::invalid_argument& error) {  // a hand at an impossible place is left out
        snapshot_.refused_hand = error.what();
      }
    }
    new_human_ = false;
    cell_.setMotors(motors_);
    cell_.setPush(push_);
    actions.swap(actions_);
    const double time = cell_.controller().time();
    const auto later = std::stable_partition(delayed_.begin(), delayed_.end(),
                                             [&](const Delayed& d) { return d.time > time; });
    std::move(later, delayed_.end(), std::back_inserter(due));
    delayed_.erase(later, delayed_.end());
  }
  for (const auto& action : actions) {
    if (!action->taken.exchange(true)) action->task(cell_);
  }
  for (auto& entry : due) entry.action(cell_);
}

void RealTimeCell::leaveResults(bool answered, bool expected, bool unanswered, double behind,
                                bool keep) {
  const std::int64_t stepped_ns = coglab_rt::steadyNow();
  const auto& controller = cell_.controller();
  TickRecord record;
  record.time = controller.time();
  record.state = static_cast<int>(controller.friState());
  record.quality = static_cast<int>(controller.friQuality());
  record.power = controller.power();
  record.control = static_cast<int>(controller.strategy());
  record.answered = answered;
  record.commanded = controller.setPoint();
  record.measured = cell_.plant().position();
  const CellTruth truth = cell_.truth();
  const MotorStates motors = cell_.motors();
  const plant::Touch touch = cell_.touch();
  const PalmReading palm = cell_.palmSensors();

  const std::lock_guard<std::mutex> lock(mutex_);
  snapshot_.truth = truth;
  snapshot_.motors = motors;
  snapshot_.touch = touch;
  snapshot_.palm = palm;
  snapshot_.stepped_ns = stepped_ns;
  ++snapshot_.tick;
  if (answered) ++snapshot_.answers;
  if (expected) ++snapshot_.sent;
  if (unanswered) ++snapshot_.unanswered;
  if (behind > 0.0) ++snapshot_.late_ticks;
  snapshot_.latest = std::max(snapshot_.latest, behind);
  if (keep && snapshots_.size() == kMaxSnapshots) snapshots_.erase(snapshots_.begin());
  if (keep) snapshots_.push_back(snapshot_);
  if (records_.size() < kMaxRecords) records_.push_back(record);
  const std::uint64_t fresh = std::min<std::uint64_t>(controller.messageCount() - messages_seen_,
                                                      controller.messages().size());
  messages_.insert(messages_.end(),
                   controller.messages().end() - static_cast<std::ptrdiff_t>(fresh),
                   controller.messages().end());
  messages_seen_ = controller.messageCount();
}

void RealTimeCell::setHuman(const plant::PersonInput& human) {
  const std::lock_guard<std::mutex> lock(mutex_);
  human_ = human;
  new_human_ = true;
}

void RealTimeCell::setMotors(const MotorCommands& motors) {
  const std::lock_guard<std::mutex> lock(mutex_);
  motors_ = motors;
}

void RealTimeCell::setPush(const Wrench& push) {
  const std::lock_guard<std::mutex> lock(mutex_);
  push_ = push;
}

void RealTimeCell::apply(std::function<void(Cell&)> action, double limit) {
  const auto asked = std::make_shared<Action>();
  asked->task = std::packaged_task<void(Cell&)>(std::move(action));
  std::future<void> done = asked->task.get_future();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    actions_.push_back(asked);
  }
  const auto wait = std::chrono::duration<double>(limit);
  if (done.wait_for(wait) != std::future_status::ready) {
    // Withdraw the action, so that it never runs, unless the thread has just begun it.
    if (!asked->taken.exchange(true)) {
      throw std::runtime_error("the simulated cell did not react within " + std::to_string(limit) +
                               " s; nothing was changed");
    }
    if (done.wait_for(wait) != std::future_status::ready) {
      throw std::runtime_error("the simulated cell did not finish within " +
                               std::to_string(2.0 * limit) + " s; it may still change");
    }
  }
  done.get();
}

void RealTimeCell::applyLater(double delay, std::function<void(Cell&)> action) {
  const std::lock_guard<std::mutex> lock(mutex_);
  delayed_.push_back({snapshot_.truth.time + delay, std::move(action)});
}

CellSnapshot RealTimeCell::snapshot() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return snapshot_;
}

double RealTimeCell::takeLatest() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(snapshot_.latest, 0.0);
}

std::vector<CellSnapshot> RealTimeCell::takeSnapshots() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(snapshots_, {});
}

std::vector<TickRecord> RealTimeCell::takeRecords() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(records_, {});
}

std::vector<krc::Message> RealTimeCell::takeMessages() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(messages_, {});
}

std::string RealTimeCell::failure() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return failure_;
}

}  // namespace coglab_sim
