#include "lwr_fri_bridge/requests/configurator.hpp"

namespace lwr_fri_bridge {
namespace {

constexpr double kProgramMarkTime = 1.0;  // s, time in which the KRL program must show its mark
constexpr double kRefusalTime =
    0.5;  // s in monitor mode, after the program ended its work on a start
constexpr double kSettleTime = 0.5;  // s; KRL programs poll every 50 ms and may still call friStart

}  // namespace

void Configurator::setPhase(fri::KrlPhase phase, const Observation& seen) {
  request_.phase = phase;
  request_.acknowledged = 0;
  request_.asserted = false;
  if (phase != fri::KrlPhase::Start && phase != fri::KrlPhase::Stop) return;
  // A KRL program that ran before this bridge started may have used any number.
  const std::int32_t finished =
      seen.measurement != nullptr ? fri::lastFinished(*seen.measurement) : 0;
  do {
    request_.number = static_cast<std::uint16_t>(request_.number % fri::kMaxRequestNumber + 1);
  } while (request_.number == finished);
}

void Configurator::finish(OutcomeCode code, const Observation& seen) {
  outcome_.code = code;
  outcome_.waited = elapsed(seen);
  outcome_.convention = convention_;
  outcome_.result = reply_.result;
  if (seen.measurement != nullptr) {
    const fri::MeasurementDatagram& m = *seen.measurement;
    outcome_.reported = static_cast<fri::ControlStrategy>(m.control);
    outcome_.state = static_cast<fri::FriState>(m.state);
    outcome_.quality = static_cast<fri::Quality>(m.quality);
    outcome_.power = m.power;
    outcome_.drive_error = m.drive_error;
  }
  step_ = Step::Ended;
}

void Configurator::start(std::uint32_t ticket, fri::ControlStrategy strategy,
                         const Observation& seen) {
  outcome_ = Outcome{};
  outcome_.ticket = ticket;
  outcome_.kind = EventKind::Start;
  outcome_.wanted = strategy;
  request_.strategy = strategy;
  request_.phase = fri::KrlPhase::Idle;
  reply_ = fri::KrlReply{};
  began_ns_ = seen.now_ns;
  seen_busy_ = false;
  step_ = Step::WaitQuality;
  if (!fri::supports(convention_, strategy)) finish(OutcomeCode::NotSupported, seen);
}

void Configurator::stop(std::uint32_t ticket, const Observation& seen) {
  settle_ = request_.phase == fri::KrlPhase::Start || request_.phase == fri::KrlPhase::Stop;
  outcome_ = Outcome{};
  outcome_.ticket = ticket;
  outcome_.kind = EventKind::Stop;
  outcome_.wanted = request_.strategy;
  reply_ = fri::KrlReply{};
  began_ns_ = seen.now_ns;
  monitor_since_ns_ = seen.now_ns;
  setPhase(fri::KrlPhase::Stop, seen);
  step_ = Step::WaitMonitor;
}

void Configurator::abandon(OutcomeCode code, const Observation& seen) {
  if (step_ == Step::Idle || step_ == Step::Ended || outcome_.kind != EventKind::Start) return;
  if (request_.phase == fri::KrlPhase::Start) setPhase(fri::KrlPhase::Stop, seen);
  finish(code, seen);
}

void Configurator::stepStart(const Observation& seen) {
  if (!seen.connected) {
    request_.phase = fri::KrlPhase::Idle;
    return finish(OutcomeCode::LostConnection, seen);
  }
  const bool command =
      seen.measurement->state == static_cast<std::uint16_t>(fri::FriState::Command);
  const bool late = elapsed(seen) > limits_.start_timeout;
  if (step_ == Step::WaitQuality) {
    if (command) {
      step_ = Step::WaitPower;  // already in command mode: no request
    } else if (seen.measurement->quality >= static_cast<std::uint16_t>(fri::Quality::Ok)) {
      setPhase(fri::KrlPhase::Start, seen);
      step_ = Step::WaitCommand;
    } else if (late) {
      return finish(OutcomeCode::PoorQuality, seen);
    }
  }
  const bool asking = step_ == Step::WaitCommand;
  if (asking && command) step_ = Step::WaitPower;
  if (asking) reply_ = fri::readReply(convention_, request_, seen.measurement->krl);
  if (step_ == Step::WaitCommand) waitCommand(seen, late);
  if (step_ == Step::WaitPower) waitPower(seen, command, late);
}

/// Cancels the start and requests monitor mode.
void Configurator::giveUp(OutcomeCode code, const Observation& seen) {
  setPhase(fri::KrlPhase::Stop, seen);
  finish(code, seen);
}

void Configurator::waitCommand(const Observation& seen, bool late) {
  if (!reply_.known && elapsed(seen) > kProgramMarkTime)
    return giveUp(OutcomeCode::NoKrlProgram, seen);
  if (reply_.refused) return giveUp(OutcomeCode::ProgramRefused, seen);
  if (late) return giveUp(OutcomeCode::NotEntered, seen);
  if (convention_ != fri::KrlConvention::RcprgTum) return;
  // This program shows only a busy flag. If the flag was set and cleared, and the controller is
  // still in monitor mode, the program has refused the request.
  if (reply_.busy) {
    seen_busy_ = true;
    monitor_since_ns_ = seen.now_ns;
  } else if (seen_busy_ &&
             1e-9 * static_cast<double>(seen.now_ns - monitor_since_ns_) > kRefusalTime) {
    giveUp(OutcomeCode::ProgramRefused, seen);
  }
}

void Configurator::waitPower(const Observation& seen, bool command, bool late) {
  if (!command) return giveUp(OutcomeCode::NotEntered, seen);
  if (seen.measurement->control != static_cast<std::uint16_t>(outcome_.wanted))
    return giveUp(OutcomeCode::WrongStrategy, seen);
  if (fri::allDrivesOn(seen.measurement->power)) {
    setPhase(fri::KrlPhase::Running, seen);
    return finish(OutcomeCode::Done, seen);
  }
  if (late) giveUp(OutcomeCode::NoPower, seen);
}

void Configurator::stepStop(const Observation& seen) {
  const double waited = elapsed(seen);
  if (!seen.connected) {
    if (waited > limits_.silent_stop_timeout) finish(OutcomeCode::LostConnection, seen);
    return;
  }
  if (seen.measurement->state != static_cast<std::uint16_t>(fri::FriState::Monitor)) {
    monitor_since_ns_ = seen.now_ns;
    if (waited > limits_.stop_timeout) finish(OutcomeCode::NotLeft, seen);
    return;
  }
  if (settle_ && 1e-9 * static_cast<double>(seen.now_ns - monitor_since_ns_) < kSettleTime) return;
  request_.phase = fri::KrlPhase::Idle;
  finish(OutcomeCode::Done, seen);
}

bool Configurator::update(const Observation& seen, Outcome& outcome) {
  if (seen.connected && seen.measurement != nullptr)
    fri::stepRequest(convention_, request_, seen.measurement->krl);
  if (step_ == Step::WaitMonitor) {
    stepStop(seen);
  } else if (step_ != Step::Idle && step_ != Step::Ended) {
    stepStart(seen);
  }
  if (step_ != Step::Ended) return false;
  step_ = Step::Idle;
  outcome = outcome_;
  return true;
}

}  // namespace lwr_fri_bridge
