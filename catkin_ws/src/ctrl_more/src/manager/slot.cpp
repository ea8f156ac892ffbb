#include "manager/slot.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "coglab_rt/clock.hpp"

namespace ctrl_more {
namespace {

// Not an index of a robot signal; see Slot::waiting_.
constexpr int kWaitsForNothing = -1, kWaitsForMotion = -2;

std::int64_t toNanoseconds(double seconds) {
  return seconds >= 9e9 ? INT64_MAX : static_cast<std::int64_t>(1e9 * seconds);
}

}  // namespace

const char* nameOf(Activity activity) {
  static const char* const names[] = {"off", "running", "stopping", "waiting"};
  return names[static_cast<int>(activity)];
}

const char* nameOf(FaultKind kind) {
  static const char* const names[] = {"none",
                                      "exception",
                                      "reported by the controller",
                                      "number that is not finite",
                                      "quaternion that is not unit",
                                      "correction larger than declared",
                                      "correction faster than declared",
                                      "write to a signal that is not declared",
                                      "overrun"};
  return names[static_cast<int>(kind)];
}

Slot::Slot(ControllerInstance instance, const std::string& name, const ControllerEntry& entry,
           const ManagerOptions& options, std::uint32_t owner)
    : instance_(std::move(instance)),
      controller_(*instance_.controller),
      owner_(owner),
      blend_s_(entry.blend_s >= 0.0 ? entry.blend_s : options.blend_s),
      overrun_ns_(toNanoseconds(1e-6 * entry.overrun_us)),
      overruns_to_pause_(options.overruns_to_pause),
      lockstep_(options.lockstep),
      on_fault_(entry.on_fault) {
  controller_.name_ = name;
}

void Slot::configure(const GainValues& gains, const SettingValues& settings, RobotStates& robot,
                     ControlStates& control, Logger* logger,
                     const std::atomic<std::uint64_t>* cycle) {
  FeedbackController& c = controller_;
  const Description description = c.declaration();
  const std::vector<std::string> faults = description.faults();
  if (!faults.empty()) throw std::invalid_argument("its description is wrong: " + faults.front());
  stage_ = description.stage;
  c.gains_ = gains;
  c.log_ = LogSource(logger, c.name_, cycle);
  const std::string complaint = c.judgeGains(gains);
  if (!complaint.empty()) throw std::invalid_argument(complaint);
  Setup setup(c.name_, description, gains, settings, robot, control, owner_);
  c.initialize(setup);
  setup.resolveAll();
  c.initialized_ = true;
  c.robot_uses_ = setup.robotUses();
  c.control_uses_ = setup.controlUses();
  for (const ResolvedRobotUse& use : c.robot_uses_) {
    needed_.push_back({use.signal, toNanoseconds(use.use.max_age_s)});
  }
  guard_.configure(c.control_uses_, control);
  from_.assign(guard_.total(), 0.0);
  for (const WrittenSignal& w : guard_.written()) {
    correction::setIdentity(w.kind, w.size, from_.data() + w.local);
  }
  now_ = left_ = from_;
  state_.assign(description.states.size(), 0.0);
  // Before and after are equal and unit, so the correction before the first run is the identity.
  for (Record& record : records_) {
    record.before = record.after = from_;
    record.state = state_;
  }
  gains_from_ = gains;
  gains_to_ = gains;
}

void Slot::adopt(const PlanEntry& entry) noexcept {
  if (entry.gains_revision != gains_revision_) {
    gains_revision_ = entry.gains_revision;
    gains_from_.assign(controller_.gains_);
    gains_to_.assign(*entry.gains);
    gain_weight_ = 0.0;
  }
  if (entry.fault_clears != fault_clears_) {
    fault_clears_ = entry.fault_clears;
    if (fault_ != FaultKind::None) reset_pending_ = true;
    fault_ = FaultKind::None;
    overruns_in_row_ = 0;
    shared_fault_.store(FaultKind::None, std::memory_order_release);
  }
  if (!enabled_ && entry.enabled) reset_pending_ = true;
  enabled_ = entry.enabled;
  paused_ = entry.paused;
  wanted_ = enabled_ && !paused_ && fault_ == FaultKind::None;
  if (entry.resets != resets_) {
    resets_ = entry.resets;
    reset_pending_ = true;
  }
  const bool moved = entry.reorders != reorders_;
  reorders_ = entry.reorders;
  const bool running = activity_ == Activity::Running;
  if (running && !wanted_) {
    stop(!enabled_ ? Why::Disabled : Why::Paused);
  } else if (running && (moved || reset_pending_)) {
    captureCorrection();
    guard_.forgetRate();
  } else if (!running && !enabled_ && activity_ != Activity::Off && why_ != Why::Disabled) {
    captureCorrection();  // disabling releases a held correction
    why_ = Why::Disabled;
    setActivity(Activity::Stopping);
  } else if (activity_ == Activity::Waiting && !wanted_) {
    setActivity(Activity::Stopping);
  }
}

// The correction of the newest record; none after letGo().
void Slot::lastCorrection(double* correction) noexcept {
  const Record& record = records_[last_];
  for (const WrittenSignal& w : guard_.written()) {
    if (let_go_) {
      correction::setIdentity(w.kind, w.size, correction + w.local);
      continue;
    }
    correction::difference(w.kind, w.size, record.before.data() + w.local,
                           record.after.data() + w.local, correction + w.local);
  }
}

void Slot::captureCorrection() noexcept {
  lastCorrection(from_.data());
  blend_ = 0.0;
  blend_begins_ = true;
}

void Slot::start() noexcept {
  captureCorrection();
  guard_.forgetRate();
  setActivity(Activity::Running);
}

void Slot::stop(Why why) noexcept {
  captureCorrection();
  why_ = why;
  guard_.forgetRate();
  setActivity(why == Why::Stale ? Activity::Waiting : Activity::Stopping);
}

void Slot::setActivity(Activity activity) noexcept {
  activity_ = activity;
  shared_activity_.store(activity, std::memory_order_release);
}

void Slot::advanceBlend(double dt) noexcept {
  if (blend_ >= 1.0) return;
  blend_ = blend_s_ > 0.0 ? std::min(1.0, blend_ + dt / blend_s_) : 1.0;
}

void Slot::advanceGains(double dt) noexcept {
  gain_weight_ = blend_s_ > 0.0 ? std::min(1.0, gain_weight_ + dt / blend_s_) : 1.0;
  controller_.gains_.blend(gains_from_, gains_to_, gain_weight_);
  gains_pending_ = true;
}

void Slot::latch(const Cycle& cycle, FaultKind kind, const char* text) noexcept {
  fault_ = kind;
  wanted_ = false;
  fault_texts_.write(text ? text : nameOf(kind));
  fault_cycle_.store(cycle.number, std::memory_order_relaxed);
  faults_.fetch_add(1, std::memory_order_relaxed);
  shared_fault_.store(kind, std::memory_order_release);
  stop(Why::Fault);
  CTRL_MORE_LOG(controller_.log_, Error, nameOf(kind));
  if (text) CTRL_MORE_LOG(controller_.log_, Error, text);
}

void Slot::run(StageRun& run) noexcept {
  if (activity_ == Activity::Off && !wanted_) return;
  if (run.let_go) return letGo(run);
  guard_.note(run.control.data());
  if (gain_weight_ < 1.0) advanceGains(run.cycle.dt);
  if (!wanted_) {
    runStopped(run);
  } else if (findStale(run)) {
    // This also releases a correction that was held during a pause or a fault.
    if (activity_ != Activity::Waiting) stop(Why::Stale);
    runStopped(run);
  } else {
    if (activity_ != Activity::Running) start();
    runActive(run);
  }
}

// Ends its correction at once. If the controller is still enabled, it restarts after letGo().
void Slot::letGo(const StageRun& run) noexcept {
  let_go_ = true;
  reset_pending_ = true;
  if (!findStale(run)) waiting_.store(kWaitsForMotion, std::memory_order_relaxed);
  if (wanted_) {
    if (activity_ != Activity::Waiting) stop(Why::Stale);
  } else {
    captureCorrection();
    setActivity(Activity::Off);
  }
}

// True if an input is missing or too old. Stores its index.
bool Slot::findStale(const StageRun& run) noexcept {
  for (std::size_t i = 0; i < needed_.size(); ++i) {
    const Needed& need = needed_[i];
    if (run.robot.isFresh(need.signal, run.cycle.now_ns, need.max_age_ns)) continue;
    waiting_.store(static_cast<int>(i), std::memory_order_relaxed);
    return true;
  }
  return false;
}

void Slot::runActive(StageRun& run) noexcept {
  try {
    const FaultKind kind = callController(run);
    if (kind != FaultKind::None) return takeFault(run, kind, nullptr);
  } catch (const std::exception& e) {
    // The text must be used before the exception is destroyed.
    return takeFault(run, FaultKind::Exception, e.what());
  } catch (...) {
    return takeFault(run, FaultKind::Exception, "it threw something that is not a std::exception");
  }
  if (run.timed && isLate(run)) return overrun(run);
  advanceBlend(run.cycle.dt);
  if (blend_ < 1.0) blendIn(run.control.data());
  commit(run);
}

// Runs the controller, which may throw, and checks its writes.
FaultKind Slot::callController(StageRun& run) {
  double* const data = run.control.data();
  const int size = run.control.dataSize();
  if (run.compared) std::copy_n(data, size, run.compared->data());
  if (reset_pending_) {
    reset_pending_ = false;
    controller_.reset();
  }
  if (gains_pending_) {
    gains_pending_ = false;
    controller_.gainsChanged();
  }
  ModifiedControlStates modified(run.control, owner_);
  controller_.update(run.cycle, run.robot, run.original, modified);
  if (controller_.failure_) return FaultKind::Declared;
  const FaultKind kind = guard_.judge(data, run.cycle.dt);
  if (kind != FaultKind::None) return kind;
  if (run.compared && guard_.restoreUndeclared(data, run.compared->data(), size)) {
    return FaultKind::Undeclared;
  }
  if (!state_.empty()) {
    controller_.state(Numbers<>(state_.data(), static_cast<int>(state_.size())));
  }
  return FaultKind::None;
}

// Undoes the controller's writes and releases its last correction.
void Slot::takeFault(StageRun& run, FaultKind kind, const char* text) noexcept {
  guard_.restore(run.control.data());
  if (run.compared) {
    guard_.restoreUndeclared(run.control.data(), run.compared->data(), run.control.dataSize());
  }
  if (kind == FaultKind::Declared) text = controller_.failure_;
  if (kind == FaultKind::Undeclared) {
    text = "it changed a reference that its description does not name";
  }
  controller_.failure_ = nullptr;
  latch(run.cycle, kind, text);
  runStopped(run);
}

// One cycle of a controller that does not run. Its last correction is held or fades.
void Slot::runStopped(StageRun& run) noexcept {
  if (activity_ == Activity::Off) return;
  advanceBlend(run.cycle.dt);
  bool holding = false;
  for (const WrittenSignal& w : guard_.written()) {
    const StopPolicy policy = policyOf(w);
    if (policy == StopPolicy::Zero || (policy == StopPolicy::Fade && blend_ >= 1.0)) continue;
    const double* c = from_.data() + w.local;
    if (policy == StopPolicy::Hold) {
      holding = true;
    } else {
      double* const fading = now_.data() + w.local;
      correction::setIdentity(w.kind, w.size, fading);
      correction::between(w.kind, w.size, c, fading, blend_, fading);
      c = fading;
    }
    double* const value = run.control.data() + w.offset;
    correction::apply(w.kind, w.size, value, c, value);
  }
  commit(run);
  if (blend_ >= 1.0 && !holding && activity_ == Activity::Stopping) setActivity(Activity::Off);
  // The duration of this function must not count for the next controller.
  if (run.timed) run.boundary_ns = coglab_rt::steadyNow();
}

// Fades the step from the last correction to the controller's first one. Later changes act at once,
// so pose and velocity stay consistent, and the controller keeps its own limits.
void Slot::blendIn(double* data) noexcept {
  for (const WrittenSignal& w : guard_.written()) {
    double* const c = now_.data() + w.local;
    double* const step = from_.data() + w.local;
    double* const left = left_.data() + w.local;
    const double* const found = guard_.found() + w.local;
    correction::difference(w.kind, w.size, found, data + w.offset, c);
    if (blend_begins_) correction::difference(w.kind, w.size, c, step, step);
    correction::setIdentity(w.kind, w.size, left);
    correction::between(w.kind, w.size, step, left, blend_, left);
    correction::apply(w.kind, w.size, c, left, c);
    correction::apply(w.kind, w.size, found, c, data + w.offset);
  }
  blend_begins_ = false;
}

StopPolicy Slot::policyOf(const WrittenSignal& written) const {
  const StopPolicy by_kind =
      written.kind == SignalKind::Vector ? StopPolicy::Fade : StopPolicy::Hold;
  switch (why_) {
    case Why::Paused:
      return written.on_pause == StopPolicy::ByKind ? by_kind : written.on_pause;
    case Why::Fault:
      return on_fault_ == StopPolicy::ByKind ? by_kind : on_fault_;
    case Why::Disabled:
    case Why::Stale:
      break;
  }
  return StopPolicy::Fade;
}

// Records the references before the controller and now.
void Slot::commit(const StageRun& run) noexcept {
  Record& record = records_[run.buffer];
  last_ = run.buffer;
  let_go_ = false;
  record.any = true;
  record.cycle = run.cycle.number;
  const double* const data = run.control.data();
  for (const WrittenSignal& w : guard_.written()) {
    std::copy_n(guard_.found() + w.local, w.size, record.before.data() + w.local);
    std::copy_n(data + w.offset, w.size, record.after.data() + w.local);
  }
  std::copy(state_.begin(), state_.end(), record.state.begin());
}

// Reads the clock once per controller: the end of one is the start of the next.
bool Slot::isLate(StageRun& run) noexcept {
  const std::int64_t now = coglab_rt::steadyNow();
  const std::int64_t duration_ns = now - run.boundary_ns;
  run.boundary_ns = now;
  last_ns_.store(duration_ns, std::memory_order_relaxed);
  if (!isTimed()) return false;
  if (duration_ns > overrun_ns_) return true;
  overruns_in_row_ = 0;
  return false;
}

// The update was too slow: discards its writes and repeats the correction of the previous cycle.
void Slot::overrun(StageRun& run) noexcept {
  overruns_.fetch_add(1, std::memory_order_relaxed);
  guard_.forgetRate();
  guard_.restore(run.control.data());
  lastCorrection(now_.data());
  for (const WrittenSignal& w : guard_.written()) {
    double* const value = run.control.data() + w.offset;
    correction::apply(w.kind, w.size, value, now_.data() + w.local, value);
  }
  commit(run);
  if (++overruns_in_row_ >= overruns_to_pause_) {
    latch(run.cycle, FaultKind::Overrun, "update() was too slow in too many cycles in a row");
  }
}

void Slot::fillStatus(ControllerStatus& status) const {
  status.name = name();
  status.stage = stage_;
  status.activity = activity();
  status.fault = fault();
  if (status.fault != FaultKind::None) {
    const std::lock_guard<std::mutex> lock(fault_text_mutex_);
    fault_texts_.take();
    const std::string kind = nameOf(status.fault), text = fault_texts_.front().str();
    status.fault_text = text == kind ? kind : kind + ": " + text;
    status.fault_cycle = fault_cycle_.load(std::memory_order_relaxed);
  }
  status.faults = faults_.load(std::memory_order_relaxed);
  status.overruns = overruns_.load(std::memory_order_relaxed);
  status.last_us = 1e-3 * static_cast<double>(last_ns_.load(std::memory_order_relaxed));
  const int waiting = waiting_.load(std::memory_order_relaxed);
  if (status.activity == Activity::Waiting && waiting != kWaitsForNothing) {
    status.waiting_for = waiting == kWaitsForMotion ? "a motion" : robotUses()[waiting].name();
  }
}

void Slot::addRecord(const ControlStates& names, unsigned buffer, CycleRecord& of_cycle) const {
  const Record& record = records_[buffer];
  if (activity() == Activity::Off || !record.any || record.cycle != of_cycle.cycle) return;
  std::vector<double> change;
  for (const WrittenSignal& w : guard_.written()) {
    const double* before = record.before.data() + w.local;
    const double* after = record.after.data() + w.local;
    change.resize(w.size);
    correction::difference(w.kind, w.size, before, after, change.data());
    const correction::Norms n = correction::norms(w.kind, w.size, change.data());
    of_cycle.changes.push_back({name(),
                                names.nameOfSignal(w.signal),
                                of_cycle.cycle,
                                {before, before + w.size},
                                {after, after + w.size},
                                n.size,
                                n.angle});
  }
  if (!record.state.empty()) of_cycle.states.push_back({name(), record.state});
}

}  // namespace ctrl_more
