#include "bridge_diagnostics.hpp"

#include <cstdio>

#include "coglab_rt/ros/parameter.hpp"
#include "lwr_fri_bridge/bridge/diagnosis.hpp"
#include "target_topic.hpp"

namespace lwr_fri_bridge {
namespace {

constexpr double kLateAnswers = 0.05;  // share of late answers of a computer that is too busy

unsigned char levelOf(Severity severity) { return static_cast<unsigned char>(severity); }

/// Adds the text of a diagnosis and its reason code.
void say(diagnostic_updater::DiagnosticStatusWrapper& status, const Diagnosis& diagnosis) {
  status.summary(levelOf(diagnosis.severity), diagnosis.text);
  status.add("reason_code", static_cast<int>(diagnosis.code));
}

}  // namespace

BridgeDiagnostics::BridgeDiagnostics(BridgeRos& owner)
    : owner_(owner),
      hot_(coglab_rt::readNumber(owner.nh_, "hot_drive", 70.0, 0.0, 200.0)),
      updater_(ros::NodeHandle(), owner.nh_, owner.nh_.getNamespace()) {
  updater_.setHardwareID("KUKA LWR 4+");
  updater_.add("FRI connection", this, &BridgeDiagnostics::connection);
  updater_.add("computer", this, &BridgeDiagnostics::computer);
  updater_.add("arm", this, &BridgeDiagnostics::arm);
  updater_.add("commands", this, &BridgeDiagnostics::commands);
}

void BridgeDiagnostics::connection(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const Snapshot s = owner_.bridge_.snapshot();
  const FriThreadStatistics thread = owner_.fri_thread_.statistics(true);
  const std::int64_t since = s.sample.stamp_ns != 0 ? s.sample.stamp_ns : owner_.started_ns_;
  const double silence = 1e-9 * static_cast<double>(steadyNow() - since);
  const Diagnosis d = diagnoseConnection(s, thread, owner_.fri_thread_.port(), silence);
  say(status, d);
  status.add("port", owner_.fri_thread_.port());
  status.add("peer", thread.peer);
  status.add("controller_address", owner_.fri_thread_.controllerAddress());
  status.add("FRI state", fri::nameOf(s.state));
  status.add("quality", fri::nameOf(s.quality));
  status.add("cycle time (s)", s.sample.cycle_time);
  status.add("answer rate", s.answer_rate);
  status.add("latency (s)", s.latency);
  status.add("jitter (s)", s.jitter);
  status.add("miss rate", s.miss_rate);
  status.add("misses", s.miss_counter);
  status.add("mean answer time (s)", thread.mean_answer_time);
  status.add("longest answer time (s)", thread.longest_answer_time);
  status.add("real-time priority", thread.real_time);
  status.add("datagrams accepted", s.session.accepted);
  status.add("measurements lost", s.session.lost_measurements);
  status.add("answers lost", s.session.lost_answers);
  status.add("rejected: wrong size", s.session.wrong_size);
  status.add("rejected: wrong id", s.session.wrong_id);
  status.add("rejected: implausible", s.session.implausible);
  status.add("rejected: doubled", s.session.duplicate);
  status.add("rejected: out of order", s.session.out_of_order);
  status.add("superseded in the queue", thread.superseded);
  status.add("restarts of the controller", s.session.restarts);
  status.add("changes of the period", s.session.new_periods);
  status.add("datagrams of a second sender", thread.foreign);
  status.add("last second sender", thread.last_foreign);
  status.add("send errors", thread.send_errors);
}

/// Share of late answers of this computer in the last second. It only reports; the robot does not
/// become slower.
void BridgeDiagnostics::computer(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const fri::SessionCounters session = owner_.bridge_.snapshot().session;
  const FriThreadStatistics thread = owner_.fri_thread_.statistics();
  const std::uint64_t late = session.lost_answers + thread.superseded;
  const std::uint64_t all = session.accepted + thread.superseded;
  const double share = all > answers_before_ ? static_cast<double>(late - late_before_) /
                                                   static_cast<double>(all - answers_before_)
                                             : 0.0;
  late_before_ = late;
  answers_before_ = all;
  const bool busy = share > kLateAnswers;
  char text[300];
  std::snprintf(text, sizeof text,
                "%.0f %% of the FRI answers of the last second were late or lost (limit %.0f %%)%s",
                100.0 * share, 100.0 * kLateAnswers,
                busy ? ": this computer is too busy, or packets are lost on the way. The arm is "
                       "not slowed; end other programs, give this node real-time priority"
                     : "");
  say(status, Diagnosis{busy ? Severity::Warning : Severity::Ok, text});
  status.add("late FRI answers (%)", 100.0 * share);
  status.add("real-time priority", thread.real_time);
  if (busy) ROS_WARN_THROTTLE(10.0, "lwr: %s", status.message.c_str());
}

void BridgeDiagnostics::arm(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const Snapshot s = owner_.bridge_.snapshot();
  const Diagnosis d = diagnoseArm(s, hot_);
  say(status, d);
  status.add("supervisor", nameOf(s.supervisor));
  status.add("control mode reported", fri::nameOf(s.control));
  status.add("control mode wanted", fri::nameOf(s.mode.strategy));
  status.addf("power", "0x%02X", s.power);
  status.addf("drive error", "0x%02X", s.drive_error);
  status.addf("drive warning", "0x%02X", s.drive_warning);
  status.add("safety scale (friStart)", s.safety_scale);
  status.add("fall-backs", s.fall_backs);
  for (std::size_t i = 0; i < 7; ++i) {
    status.add(std::string("temperature ") + kJointNames[i] + " (degC)", s.temperature[i]);
  }
}

void BridgeDiagnostics::commands(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const Snapshot s = owner_.bridge_.snapshot();
  const TargetTopic::Refused refused = owner_.target_->refused();
  const std::uint64_t total = refused.total() + s.counters.commands_invalid;
  const Diagnosis refusals{Severity::Warning, "target velocities were refused",
                           ReasonCode::CommandsRefused};
  say(status, total > refused_before_ ? refusals : Diagnosis{Severity::Ok, "ok"});
  refused_before_ = total;
  status.add("refused: not valid", refused.invalid + s.counters.commands_invalid);
  status.add("refused: stamp missing, too old or from the future", refused.stamp);
  status.add("refused: made before motion was allowed", refused.old_permission);
  status.add("refused: a controller is active", refused.controller_active);
  status.add("refused: another publisher moves the arm", refused.second_publisher);
  status.add("refused: motion not allowed", refused.not_allowed);
  status.add("ignored: older than the permission", s.counters.commands_old_epoch);
  status.add("commands stopped while moving", s.counters.command_timeouts);
  status.add("resumed after a gap", s.counters.resumed_after_gap);
  status.add("ticks bounded by braking distance", s.counters.position_bounds);
  status.add("leash trips", s.counters.leash_trips);
  status.add("events dropped, too many at once", s.counters.requests_dropped);
}

}  // namespace lwr_fri_bridge
