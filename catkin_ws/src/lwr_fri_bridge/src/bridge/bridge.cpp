#include "lwr_fri_bridge/bridge/bridge.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <thread>

#include "lwr_fri_bridge/motion/hand_guiding.hpp"

namespace lwr_fri_bridge {
namespace {

constexpr double kCommandCycles = 2.5;     // minimum lifetime of a command, FRI cycles
constexpr double kWaitBeyondLimits = 2.0;  // s, added to a request's time limits in command()
constexpr std::size_t kKeptOutcomes = 64;

double seconds(std::int64_t from_ns, std::int64_t to_ns) {
  return 1e-9 * static_cast<double>(to_ns - from_ns);
}

}  // namespace

bool StateView::operator==(const StateView& o) const {
  return supervisor == o.supervisor && block == o.block && hold_latched == o.hold_latched &&
         blocking_joint == o.blocking_joint && motion_epoch == o.motion_epoch && loss == o.loss &&
         state == o.state && quality == o.quality && control == o.control && power == o.power &&
         drive_error == o.drive_error && drive_warning == o.drive_warning &&
         cycle_time == o.cycle_time;
}

Bridge::Bridge(const BridgeConfig& config)
    : config_((config.check(), config)),
      session_(config.lenient_headers),
      velocity_filter_(config.velocity_filter_time),
      interpolator_(config.limits),
      braking_(config.limits, config.position_margin),
      configurator_(config.krl_convention, config.tool_number, config.requests),
      wanted_mode_(config.mode),
      active_mode_(config.mode) {
  sample_.stop_rounding = 2.0 * coglab_rt::kWireRounding;
  changes_.push(last_view_);
  publish();
}

// FRI thread

bool Bridge::answer(const std::uint8_t* datagram, std::size_t size, std::int64_t now_ns,
                    fri::CommandDatagram& answer) {
  if (!compute(datagram, size, now_ns, answer)) return false;
  publish();
  return true;
}

bool Bridge::compute(const std::uint8_t* datagram, std::size_t size, std::int64_t now_ns,
                     fri::CommandDatagram& answer) {
  const fri::Reception reception = session_.receive(datagram, size, measurement_);
  if (reception.verdict != fri::Verdict::Accepted) return false;

  const bool first_contact = !connected_;
  connected_ = true;
  last_receive_ns_ = now_ns;
  const double dt = fri::cycleTimeOf(measurement_);
  if (reception.fresh_session || reception.new_period) velocity_filter_.reset();
  if (first_contact || reception.new_period) following_ = false;

  sample_.stamp_ns = now_ns;
  sample_.cycle_time = dt;
  sample_.stop_delay = coglab_rt::lostTime(dt);
  sample_.controller_ns += static_cast<std::int64_t>(std::llround(1e9 * dt * reception.cycles));
  sample_.position = fri::jointsFromWire(measurement_.measured_position);
  sample_.velocity = velocity_filter_.update(sample_.position, reception.cycles, dt);
  sample_.torque = fri::jointsFromWire(measurement_.measured_torque);
  sample_.external_torque = fri::jointsFromWire(measurement_.external_torque);
  sample_.tool_wrench = toolWrench(measurement_, config_.wrench_in_tool_axes);
  ++sample_.sequence;
  const bool unseen = !reception.fresh_session && !reception.answer_arrived;
  watch_.tick(dt * reception.cycles, reception.cycles - 1 + (unseen ? 1 : 0),
              sample_.velocity.cwiseAbs().maxCoeff(),
              sample_.commanded_velocity.cwiseAbs().maxCoeff());

  const bool monitor = measurement_.state == static_cast<std::uint16_t>(fri::FriState::Monitor);
  if (first_contact && !monitor) {
    // Another program has started command mode. The flags must not change now, so use the
    // controller's strategy.
    active_mode_ = wanted_mode_;
    active_mode_.strategy = static_cast<fri::ControlStrategy>(measurement_.control);
  }

  const Configurator::Observation seen{true, &measurement_, now_ns};
  serveRequests(seen);
  runSupervision(seen, reception.fresh_session);
  if (monitor) active_mode_ = wanted_mode_;

  answer = fri::CommandDatagram{};
  // Before move(), which records the answer under this counter: so a lost answer is known.
  answer.header = session_.nextHeader();
  move(reception, answer);
  fillMode(answer);
  configurator_.write(answer.krl);
  return true;
}

void Bridge::idle(std::int64_t now_ns) {
  const double limit = std::max(config_.receive_timeout, 5.0 * sample_.cycle_time);
  if (connected_ && seconds(last_receive_ns_, now_ns) > limit) {
    connected_ = false;
    following_ = false;
    session_.forget();
    leash_.reset();
  }
  const Configurator::Observation seen{connected_, sample_.sequence > 0 ? &measurement_ : nullptr,
                                       now_ns};
  serveRequests(seen);
  runSupervision(seen, false);
  publish();
}

void Bridge::finish(const Request& request, OutcomeCode code) {
  Outcome outcome;
  outcome.ticket = request.ticket;
  outcome.kind = request.event.kind;
  outcome.code = code;
  outcome.wanted =
      request.event.kind == EventKind::Mode ? request.event.mode.strategy : wanted_mode_.strategy;
  outcome.reported = static_cast<fri::ControlStrategy>(measurement_.control);
  outcome.state = static_cast<fri::FriState>(measurement_.state);
  outcome.quality = static_cast<fri::Quality>(measurement_.quality);
  outcome.convention = config_.krl_convention;
  outcomes_.push(outcome);
}

void Bridge::serveRequests(const Configurator::Observation& seen) {
  Request request;
  while (requests_.pop(request)) serve(request, seen);
}

void Bridge::serve(const Request& request, const Configurator::Observation& seen) {
  const bool monitor =
      connected_ && measurement_.state == static_cast<std::uint16_t>(fri::FriState::Monitor);
  switch (request.event.kind) {
    case EventKind::Hold:
      supervisor_.hold();
      configurator_.abandon(OutcomeCode::Interrupted, seen);
      return finish(request, OutcomeCode::Done);
    case EventKind::Reset:
      if (!supervisor_.held()) return finish(request, OutcomeCode::AlreadyThere);
      supervisor_.reset();
      return finish(request, OutcomeCode::Done);
    case EventKind::Mode:
      if (supervisor_.held()) return finish(request, OutcomeCode::Held);
      if (connected_ && !monitor) return finish(request, OutcomeCode::InCommandMode);
      if (supervisor_.starting()) return finish(request, OutcomeCode::Busy);
      wanted_mode_ = request.event.mode;
      return finish(request, OutcomeCode::Done);
    case EventKind::Start:
      if (!connected_) return finish(request, OutcomeCode::Disconnected);
      if (supervisor_.held()) return finish(request, OutcomeCode::Held);
      if (supervisor_.stopping() || supervisor_.starting())
        return finish(request, OutcomeCode::Busy);
      if (supervisor_.state() == SupervisorState::Command)
        return finish(request, OutcomeCode::AlreadyThere);
      supervisor_.startBegins();
      configurator_.start(request.ticket, monitor ? wanted_mode_.strategy : active_mode_.strategy,
                          seen);
      return;
    case EventKind::Stop:
      if (supervisor_.stopping()) return finish(request, OutcomeCode::Busy);
      if (!connected_) return finish(request, OutcomeCode::Disconnected);
      if (monitor && !supervisor_.starting()) {
        supervisor_.stopEnds();
        return finish(request, OutcomeCode::AlreadyThere);
      }
      configurator_.abandon(OutcomeCode::Interrupted, seen);
      supervisor_.stopBegins();
      stop_ = {request.ticket, seen.now_ns, false};
      return;
  }
}

void Bridge::runSupervision(const Configurator::Observation& seen, bool fresh_session) {
  Outcome ended;
  if (configurator_.update(seen, ended)) {
    outcomes_.push(ended);
    if (ended.kind == EventKind::Start && supervisor_.starting())
      supervisor_.startEnds(ended.success());
    if (ended.kind == EventKind::Stop) supervisor_.stopEnds();
  }

  SupervisorInput input;
  input.connected = connected_;
  input.fresh_session = fresh_session;
  input.command_mode = measurement_.state == static_cast<std::uint16_t>(fri::FriState::Command);
  input.full_power = fri::allDrivesOn(measurement_.power);
  input.quality_unacceptable =
      measurement_.quality == static_cast<std::uint16_t>(fri::Quality::Unacceptable);
  input.drive_error = (measurement_.drive_error & fri::kAllDrivesOn) != 0;
  input.stands_still = interpolator_.standsStill();
  input.leashed = leash_.joint() >= 0;
  const std::uint32_t fall_backs = supervisor_.fallBacks(), epoch = supervisor_.epoch();
  supervisor_.update(input);
  if (supervisor_.epoch() != epoch) permission_since_ns_ = seen.now_ns;
  if (supervisor_.fallBacks() != fall_backs) {
    configurator_.fellBack();
    // Poor quality and drive errors do not end command mode, and have separate messages.
    const bool still_there = input.command_mode && input.full_power && !fresh_session;
    loss_ = still_there && connected_
                ? CommandModeLoss{}
                : watch_.judge({connected_, fresh_session, input.command_mode,
                                seconds(last_receive_ns_, seen.now_ns), sample_.cycle_time,
                                measurement_.timestamp, sample_.position});
  }
  if (supervisor_.state() == SupervisorState::Command) loss_ = CommandModeLoss{};

  // A stop has two parts: the supervisor brakes, then the configurator requests monitor mode.
  const bool brake_too_long = seconds(stop_.began_ns, seen.now_ns) > kBrakeTimeLimit;
  if (supervisor_.stopping() && !stop_.monitor_asked &&
      (supervisor_.readyForMonitor() || brake_too_long)) {
    stop_.monitor_asked = true;
    configurator_.stop(stop_.ticket, seen);
  }
}

void Bridge::move(const fri::Reception& reception, fri::CommandDatagram& answer) {
  bounded_joints_ = 0;
  const bool command_mode =
      measurement_.state == static_cast<std::uint16_t>(fri::FriState::Command);
  if (command_mode && fri::allDrivesOn(measurement_.power)) {
    follow(reception, answer);
  } else {
    mirror(answer);
  }
  sample_.commanded_position = interpolator_.position();
  sample_.commanded_velocity = interpolator_.velocity();
  sample_.commanded_acceleration = interpolator_.acceleration();
}

void Bridge::mirror(fri::CommandDatagram& answer) {
  fri::setPointOf(measurement_, answer.joint_position);
  fri::cartesianSetPointOf(measurement_, answer.cartesian_frame);
  interpolator_.reset(fri::jointsFromWire(answer.joint_position));
  leash_.reset();
  following_ = false;
  target_.expired = false;
  session_.sent(fri::SentSetPoint());
}

/// Starts or continues the interpolator at the controller's set-point, with its velocity and
/// acceleration.
void Bridge::takeOver(const fri::Reception& reception) {
  if (following_ && !reception.fresh_session && !reception.gap()) return;
  float frame[fri::kFrameValues];
  fri::cartesianSetPointOf(measurement_, frame);
  fri::SetPointHistory& history = session_.history();
  fri::SetPointState state;
  if (following_) {
    state = history.afterGap(measurement_, reception.fresh_session);
    ++counters_.resumed_after_gap;
  } else {
    float joints[fri::kJoints];
    fri::setPointOf(measurement_, joints);
    state.position = fri::jointsFromWire(joints);
  }
  if (!following_ || reception.fresh_session) history.beginWith(measurement_, state);
  interpolator_.resume(state.position, state.velocity, state.acceleration);
  cartesian_.anchor(state.position, frame);
  following_ = true;
}

void Bridge::noteSent(const Vector7& from, const fri::CommandDatagram& answer) {
  fri::SentSetPoint sent;
  sent.followed = true;
  sent.from = from;
  sent.position = interpolator_.position();
  sent.velocity = interpolator_.velocity();
  sent.acceleration = interpolator_.acceleration();
  std::copy(std::begin(answer.cartesian_frame), std::end(answer.cartesian_frame), sent.frame);
  session_.sent(sent);
}

void Bridge::follow(const fri::Reception& reception, fri::CommandDatagram& answer) {
  takeOver(reception);
  const Vector7 from = interpolator_.position();
  const Vector7 wanted = targetVelocity();
  Vector7 target = wanted;
  const double excess = (target.cwiseAbs().array() / config_.limits.velocity.array()).maxCoeff();
  if (excess > 1.0)
    target /= excess;  // scales the whole vector to keep the direction of the motion

  const bool stopping = supervisor_.state() == SupervisorState::Stopping;
  if (wanted.isZero() && isHandGuiding(active_mode_) && !stopping) {
    leash_.reset();
    target = velocityToArm(interpolator_, sample_.position, config_.limits);
  } else {
    const bool was_leashed = leash_.joint() >= 0;
    leash_.update(interpolator_, sample_.position, wanted, leashOf(active_mode_, config_.leash),
                  config_.limits, target);
    if (!was_leashed && leash_.joint() >= 0) ++counters_.leash_trips;
  }

  bounded_joints_ = braking_.bound(interpolator_, sample_.cycle_time, target);
  if (bounded_joints_ != 0) ++counters_.position_bounds;
  interpolator_.step(target, sample_.cycle_time);
  fri::jointsToWire(interpolator_.position(), answer.joint_position);
  if (active_mode_.strategy == fri::ControlStrategy::CartesianImpedance) {
    cartesian_.frame(interpolator_.position(), answer.cartesian_frame);
  } else {
    fri::cartesianSetPointOf(measurement_, answer.cartesian_frame);
  }
  noteSent(from, answer);
}

Vector7 Bridge::targetVelocity() {
  const VelocitySource source = source_.load(std::memory_order_relaxed);
  const bool from_topic = source == VelocitySource::Topic;
  if (source != target_.source) target_.command = VelocityCommand();  // of the old source
  target_.source = source;
  VelocityCommand command;
  const bool fresh = from_topic ? topic_.read(command) : mailboxes_.takeVelocity(command);
  if (fresh && command.stamp_ns != 0) {
    if (!command.velocity.allFinite()) {
      ++counters_.commands_invalid;
    } else if (command.motion_epoch != supervisor_.epoch()) {
      ++counters_.commands_old_epoch;
    } else {
      target_.command = command;
    }
  }

  const double age = seconds(target_.command.stamp_ns, sample_.stamp_ns);
  // With long FRI periods a command is two cycles old before the next one can arrive.
  const double limit = std::max(from_topic ? config_.topic_timeout : config_.command_timeout,
                                kCommandCycles * sample_.cycle_time);
  const bool current =
      target_.command.stamp_ns != 0 && target_.command.motion_epoch == supervisor_.epoch();
  const bool expired = current && (age > limit || age < -limit);
  if (expired && !target_.expired && !target_.command.velocity.isZero()) {
    ++counters_.command_timeouts;
  }
  target_.expired = expired;
  // While leashed the target is still read, to detect that no outward motion is requested.
  const bool allowed =
      supervisor_.block() == MotionBlock::None || supervisor_.block() == MotionBlock::Leashed;
  return current && !expired && allowed ? target_.command.velocity : Vector7::Zero();
}

void Bridge::fillMode(fri::CommandDatagram& answer) const {
  // Added torques and forces stay 0. The bridge does not command them, and a step in them makes the
  // controller open its contactors.
  answer.flags = fri::flagsFor(active_mode_.strategy);
  fri::jointsToWire(active_mode_.joint_stiffness, answer.joint_stiffness);
  fri::jointsToWire(active_mode_.joint_damping, answer.joint_damping);
  fri::wrenchToWire(active_mode_.cartesian_stiffness, answer.cartesian_stiffness);
  fri::wrenchToWire(active_mode_.cartesian_damping, answer.cartesian_damping);
}

void Bridge::publish() {
  sample_.block = supervisor_.block();
  sample_.motion_epoch = supervisor_.epoch();
  sample_.blocking_joint = static_cast<std::int8_t>(leash_.joint());
  mailboxes_.publishSample(sample_);

  Snapshot snapshot;
  snapshot.supervisor = supervisor_.state();
  snapshot.block = sample_.block;
  snapshot.hold_latched = supervisor_.held();
  snapshot.blocking_joint = sample_.blocking_joint;
  snapshot.motion_epoch = sample_.motion_epoch;
  snapshot.loss = loss_;
  snapshot.state = connected_ ? static_cast<fri::FriState>(measurement_.state) : fri::FriState::Off;
  snapshot.quality =
      connected_ ? static_cast<fri::Quality>(measurement_.quality) : fri::Quality::Unacceptable;
  snapshot.control = static_cast<fri::ControlStrategy>(measurement_.control);
  snapshot.power = measurement_.power;
  snapshot.drive_error = measurement_.drive_error;
  snapshot.drive_warning = measurement_.drive_warning;
  snapshot.cycle_time = sample_.cycle_time;

  snapshot.sample = sample_;
  snapshot.permission_since_ns = permission_since_ns_;
  snapshot.session = session_.counters();
  snapshot.counters = counters_;
  snapshot.request_busy = configurator_.busy();
  snapshot.fall_backs = supervisor_.fallBacks();
  snapshot.mode = wanted_mode_;
  snapshot.answer_rate = measurement_.answer_rate;
  snapshot.latency = measurement_.latency;
  snapshot.jitter = measurement_.jitter;
  snapshot.miss_rate = measurement_.miss_rate;
  snapshot.miss_counter = measurement_.miss_counter;
  snapshot.safety_scale = measurement_.safety_scale;
  snapshot.timestamp = measurement_.timestamp;
  std::copy(std::begin(measurement_.temperature), std::end(measurement_.temperature),
            snapshot.temperature.begin());
  snapshot.bounded_joints = bounded_joints_;
  snapshots_.write(snapshot);
  const StateView& view = snapshot;
  if (!(view == last_view_) && changes_.push(view)) last_view_ = view;
}

// threads other than the FRI thread

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
