// What other threads than the FRI thread ask of the bridge.
#include <algorithm>
#include <chrono>
#include <thread>

#include "lwr_fri_bridge/bridge/bridge.hpp"

namespace lwr_fri_bridge {
namespace {

constexpr double kWaitBeyondLimits =
    2.0;  // s that command() waits beyond the limits of the request itself
constexpr std::size_t kKeptOutcomes = 64;

}  // namespace

std::uint32_t Bridge::submit(const std::string& text) {
  const std::lock_guard<std::mutex> lock(mutex_);
  collectOutcomes();
  Snapshot newest;
  snapshots_.read(newest);
  Request request;
  request.event = parseEvent(text, newest.mode);
  request.ticket = next_ticket_++;
  if (!requests_.push(request)) {
    ++requests_dropped_;
    Outcome dropped;
    dropped.ticket = request.ticket;
    dropped.kind = request.event.kind;
    dropped.code = OutcomeCode::NotServed;
    ended_[request.ticket] = dropped;
  }
  return request.ticket;
}

void Bridge::collectOutcomes() {
  Outcome ended;
  while (outcomes_.pop(ended)) ended_[ended.ticket] = ended;
  while (ended_.size() > kKeptOutcomes) ended_.erase(ended_.begin());
}

Outcome Bridge::outcome(std::uint32_t ticket) {
  const std::lock_guard<std::mutex> lock(mutex_);
  collectOutcomes();
  const auto found = ended_.find(ticket);
  if (found == ended_.end()) {
    Outcome pending;
    pending.ticket = ticket;
    return pending;
  }
  const Outcome ended = found->second;
  ended_.erase(found);
  return ended;
}

Outcome Bridge::command(const std::string& event) {
  using Clock = std::chrono::steady_clock;
  const auto began = Clock::now();
  const std::uint32_t ticket = submit(event);
  const double limit =
      std::max(config_.requests.start_timeout, kBrakeTimeLimit + config_.requests.stop_timeout) +
      kWaitBeyondLimits;
  for (;;) {
    Outcome ended = outcome(ticket);
    if (ended.code != OutcomeCode::Pending) return ended;
    const double waited = std::chrono::duration<double>(Clock::now() - began).count();
    if (waited > limit) {
      ended.code = OutcomeCode::NotServed;
      ended.waited = waited;
      return ended;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

Snapshot Bridge::snapshot() {
  const std::lock_guard<std::mutex> lock(mutex_);
  Snapshot newest;
  snapshots_.read(newest);
  newest.counters.requests_dropped = requests_dropped_;
  return newest;
}

}  // namespace lwr_fri_bridge
