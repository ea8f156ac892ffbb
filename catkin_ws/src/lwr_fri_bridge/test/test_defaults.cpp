/// What is not set: defaults of the parameters as the README lists them, both ends of their ranges,
/// and messages in which nothing has been seen yet.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "lwr_fri_bridge/bridge/diagnosis.hpp"
#include "lwr_fri_bridge/requests/target_command.hpp"
#include "small_controller.hpp"

namespace lwr_fri_bridge {
namespace {

TEST(Defaults, ParametersAreThoseOfTheReadme) {
  const BridgeConfig config;
  EXPECT_EQ(config.krl_convention, fri::KrlConvention::Coglab);
  EXPECT_EQ(config.tool_number, 1);
  EXPECT_FALSE(config.lenient_headers);
  EXPECT_FALSE(config.wrench_in_tool_axes);
  EXPECT_EQ(config.position_margin, 0.01);
  EXPECT_EQ(config.leash.position, 0.05);
  EXPECT_EQ(config.leash.impedance, 0.10);
  EXPECT_EQ(config.leash.load, 10.0);
  EXPECT_EQ(config.velocity_filter_time, 0.008);
  EXPECT_EQ(config.command_timeout, 0.05);
  EXPECT_EQ(config.topic_timeout, 0.1);
  EXPECT_EQ(config.receive_timeout, 0.25);
  EXPECT_EQ(config.requests.start_timeout, 10.0);
  EXPECT_EQ(config.requests.stop_timeout, 2.0);
  EXPECT_EQ(config.requests.silent_stop_timeout, 1.0);
  const FriThreadOptions thread;
  EXPECT_EQ(thread.address, "127.0.0.1");
  EXPECT_EQ(thread.port, 49938);
  EXPECT_EQ(thread.controller_address, "");
  EXPECT_EQ(thread.priority, 80);
  EXPECT_EQ(thread.stack_bytes, 262144U);
}

/// What config/lwr.yaml sets is the default: a node started without the file does the same.
TEST(Defaults, TheShippedFileChangesNothing) {
  const std::string here = LIMITS_FILE;  // beside this package
  const std::string packages = here.substr(0, here.rfind("/lwr_description/"));
  const YAML::Node shipped = YAML::LoadFile(packages + "/lwr_fri_bridge/config/lwr.yaml");
  const BridgeConfig config;
  const FriThreadOptions thread;
  const std::vector<std::pair<const char*, double>> numbers = {
      {"fri_port", thread.port},
      {"velocity_filter_time", config.velocity_filter_time},
      {"command_timeout", config.command_timeout},
      {"topic_timeout", config.topic_timeout},
      {"receive_timeout", config.receive_timeout},
      {"start_timeout", config.requests.start_timeout},
      {"stop_timeout", config.requests.stop_timeout},
      {"silent_stop_timeout", config.requests.silent_stop_timeout},
      {"rt_priority", thread.priority}};
  for (const auto& [name, value] : numbers) EXPECT_EQ(shipped[name].as<double>(), value) << name;
  const YAML::Node leash = shipped["set_point_leash"];
  EXPECT_EQ(leash["position"].as<double>(), config.leash.position);
  EXPECT_EQ(leash["impedance"].as<double>(), config.leash.impedance);
  EXPECT_EQ(leash["load"].as<double>(), config.leash.load);
  EXPECT_EQ(shipped["fri_address"].as<std::string>(), thread.address);
  EXPECT_EQ(shipped["krl_convention"].as<std::string>(), "coglab");
  EXPECT_EQ(shipped["control_mode"].as<std::string>(), "position");
  EXPECT_EQ(shipped["wrench_axes"].as<std::string>(), "base");
}

TEST(Defaults, StiffnessAndDampingAreThoseOfExistingClients) {
  const ControlMode mode;
  EXPECT_EQ(mode.strategy, fri::ControlStrategy::Position);
  EXPECT_EQ(mode.joint_stiffness, Vector7::Constant(1000.0));
  EXPECT_EQ(mode.joint_damping, Vector7::Constant(0.7));
  EXPECT_EQ(mode.cartesian_stiffness, (Vector6() << 2000, 2000, 2000, 200, 200, 200).finished());
  EXPECT_EQ(mode.cartesian_damping, Vector6::Constant(0.7));
}

/// A parameter by its name, and both ends of its range.
struct Range {
  const char* name;
  double low, high;
  std::function<void(BridgeConfig&, double)> set;
};

std::vector<Range> ranges() {
  using C = BridgeConfig;
  return {{"tool_number", 0, 16, [](C& c, double v) { c.tool_number = static_cast<int>(v); }},
          {"set_point_leash/position", 0.005, 0.5, [](C& c, double v) { c.leash.position = v; }},
          {"set_point_leash/impedance", 0.005, 0.5, [](C& c, double v) { c.leash.impedance = v; }},
          {"set_point_leash/load", 0.0, 70.0, [](C& c, double v) { c.leash.load = v; }},
          {"velocity_filter_time", 0.0, 0.2, [](C& c, double v) { c.velocity_filter_time = v; }},
          {"command_timeout", 0.005, 1.0, [](C& c, double v) { c.command_timeout = v; }},
          {"topic_timeout", 0.005, 1.0, [](C& c, double v) { c.topic_timeout = v; }},
          {"receive_timeout", 0.05, 5.0, [](C& c, double v) { c.receive_timeout = v; }},
          {"start_timeout", 0.5, 120.0, [](C& c, double v) { c.requests.start_timeout = v; }},
          {"stop_timeout", 0.1, 30.0, [](C& c, double v) { c.requests.stop_timeout = v; }},
          {"silent_stop_timeout", 0.1, 30.0,
           [](C& c, double v) { c.requests.silent_stop_timeout = v; }},
          {"limits.velocity", 1e-3, 10.0, [](C& c, double v) { c.limits.velocity[6] = v; }},
          {"limits.velocity", 1e-3, 10.0, [](C& c, double v) { c.limits.velocity[0] = v; }},
          {"limits.acceleration", 1e-2, 1e3, [](C& c, double v) { c.limits.acceleration[6] = v; }},
          {"limits.acceleration", 1e-2, 1e3, [](C& c, double v) { c.limits.acceleration[0] = v; }},
          {"limits.jerk", 0.1, 1e6, [](C& c, double v) { c.limits.jerk[6] = v; }},
          {"limits.jerk", 0.1, 1e6, [](C& c, double v) { c.limits.jerk[0] = v; }}};
}

std::string refusal(const BridgeConfig& config) {
  try {
    config.check();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

TEST(Defaults, BothEndsOfARangeAreInItAndNothingBeyond) {
  for (const Range& range : ranges()) {
    for (const bool upper : {false, true}) {
      BridgeConfig config = test::defaultConfig();
      const double end = upper ? range.high : range.low;
      range.set(config, end);
      EXPECT_EQ(refusal(config), "") << range.name;
      const bool whole = std::string(range.name) == "tool_number";
      const double step = whole ? 1.0 : 1e-4 * std::max(end, 0.1);
      const double beyond = upper ? end + step : end - step;
      range.set(config, beyond);
      std::ostringstream expected;
      expected << "parameter " << range.name << " = " << beyond << " is outside its range "
               << range.low << ".." << range.high;
      EXPECT_EQ(refusal(config), expected.str());
    }
  }
}

TEST(Defaults, TheMarginIsAtMostTheTablesAndLeavesARange) {
  BridgeConfig config = test::defaultConfig();
  config.position_margin = 0.0;
  EXPECT_EQ(refusal(config), "");
  config.position_margin = -0.001;
  EXPECT_EQ(refusal(config), "parameter position_margin = -0.001 is outside its range 0..0.5");
  config.limits.position_margin = config.position_margin = 0.5;
  EXPECT_EQ(refusal(config), "");
  config.limits.position_margin = config.position_margin = 0.501;
  EXPECT_NE(refusal(config).find("outside its range 0..0.5"), std::string::npos);
  config.limits.position_margin = config.position_margin = 0.25;
  for (const int joint : {0, 6}) {
    BridgeConfig narrow = config;
    narrow.limits.lower_position[joint] = -0.25;
    narrow.limits.upper_position[joint] = 0.25;
    EXPECT_EQ(refusal(narrow), "");
    narrow.limits.upper_position[joint] = 0.24;
    EXPECT_EQ(refusal(narrow),
              "parameter position_margin (twice, within the range of a joint) = 0.5 is outside its "
              "range 0..0.49");
  }
}

TEST(Defaults, TheTableOfEveryJointIsCheckedByName) {
  for (const int joint : {0, 6}) {
    BridgeConfig config = test::defaultConfig();
    config.limits.names[static_cast<std::size_t>(joint)] = "elbow";
    EXPECT_EQ(refusal(config).find("joint limits: joints[" + std::to_string(joint) +
                                   "] = 'elbow': expected '" + kJointNames[joint] + "'"),
              0U)
        << refusal(config);
  }
}

TEST(Defaults, ASnapshotOfNothingIsEmpty) {
  const Snapshot s;
  EXPECT_EQ(s.permission_since_ns, 0);
  EXPECT_EQ(s.supervisor, SupervisorState::Disconnected);
  EXPECT_FALSE(s.hold_latched);
  EXPECT_FALSE(s.request_busy);
  EXPECT_EQ(s.fall_backs + s.miss_counter + s.bounded_joints, 0U);
  EXPECT_EQ(s.state, fri::FriState::Off);
  EXPECT_EQ(s.quality, fri::Quality::Unacceptable);
  EXPECT_EQ(s.control, fri::ControlStrategy::Other);
  EXPECT_EQ(s.power + s.drive_error + s.drive_warning, 0);
  for (const float value :
       {s.answer_rate, s.latency, s.jitter, s.miss_rate, s.safety_scale, s.timestamp})
    EXPECT_EQ(value, 0.0F);
  EXPECT_EQ(s.temperature, (std::array<float, 7>{}));
  const BridgeCounters& c = s.counters;
  for (const std::uint64_t count :
       {c.commands_invalid, c.commands_old_epoch, c.command_timeouts, c.resumed_after_gap,
        c.position_bounds, c.leash_trips, c.requests_dropped})
    EXPECT_EQ(count, 0U);
  const fri::SessionCounters& n = s.session;
  for (const std::uint64_t count :
       {n.accepted, n.wrong_size, n.wrong_id, n.implausible, n.duplicate, n.out_of_order,
        n.lost_measurements, n.lost_answers, n.restarts, n.new_periods})
    EXPECT_EQ(count, 0U);
  EXPECT_EQ(n.rejected(), 0U);
  const CommandModeLoss loss;
  EXPECT_EQ(loss.cause, LossCause::None);
  EXPECT_EQ(loss.seconds, 0.0);
  EXPECT_EQ(loss.timestamp, 0.0F);
  EXPECT_FALSE(loss.at_rest);
}

TEST(Defaults, AViewOfNothingIsADisconnectedArm) {
  const StateView view;
  EXPECT_EQ(view.supervisor, SupervisorState::Disconnected);
  EXPECT_EQ(view.block, MotionBlock::Disconnected);
  EXPECT_FALSE(view.hold_latched);
  EXPECT_EQ(view.blocking_joint, -1);
  EXPECT_EQ(view.motion_epoch, 0U);
  EXPECT_EQ(view.state, fri::FriState::Off);
  EXPECT_EQ(view.power + view.drive_error + view.drive_warning, 0);
  EXPECT_EQ(view.cycle_time, 0.0);
  const QuietRestart::View seen;
  EXPECT_FALSE(seen.stopped || seen.held || seen.may_command);
  EXPECT_EQ(seen.timestamp, 0.0F);
  const CommandModeWatch::Facts facts;
  EXPECT_FALSE(facts.connected || facts.fresh_session || facts.command_mode);
  EXPECT_EQ(facts.silence + facts.cycle_time, 0.0);
  EXPECT_EQ(facts.timestamp, 0.0F);
  const SupervisorInput input;
  EXPECT_FALSE(input.connected || input.fresh_session || input.command_mode || input.full_power ||
               input.quality_unacceptable || input.drive_error || input.stands_still ||
               input.leashed);
}

TEST(Defaults, RequestsAndOutcomesBeginEmpty) {
  const Outcome o;
  EXPECT_EQ(o.ticket, 0U);
  EXPECT_EQ(o.kind, EventKind::Hold);
  EXPECT_EQ(o.code, OutcomeCode::Pending);
  EXPECT_EQ(o.state, fri::FriState::Off);
  EXPECT_EQ(o.power + o.drive_error, 0);
  EXPECT_EQ(o.waited, 0.0);
  EXPECT_FALSE(o.success());
  const fri::KrlRequest request;
  EXPECT_EQ(request.phase, fri::KrlPhase::Idle);
  EXPECT_EQ(request.strategy, fri::ControlStrategy::Position);
  EXPECT_EQ(request.number + request.tool + request.acknowledged, 0);
  EXPECT_FALSE(request.asserted);
  const fri::KrlReply reply;
  EXPECT_TRUE(reply.known);
  EXPECT_FALSE(reply.busy || reply.refused);
  const Configurator::Observation seen;
  EXPECT_FALSE(seen.connected);
  EXPECT_EQ(seen.measurement, nullptr);
  EXPECT_EQ(seen.now_ns, 0);
  const TargetPermission permission;
  EXPECT_EQ(permission.epoch, 0U);
  EXPECT_EQ(permission.since_ns + permission.now_ns + permission.longest_ns, 0);
  const fri::SentSetPoint sent;
  EXPECT_EQ(sent.counter + sent.measurement, 0);
  EXPECT_FALSE(sent.valid || sent.followed);
  const FriThreadStatistics thread;
  EXPECT_EQ(thread.answers + thread.superseded + thread.foreign + thread.send_errors, 0U);
  EXPECT_EQ(thread.mean_answer_time + thread.longest_answer_time, 0.0);
  EXPECT_FALSE(thread.real_time);
  EXPECT_EQ(static_cast<int>(Severity::Ok), 0);
  EXPECT_EQ(static_cast<int>(Severity::Warning), 1);
  EXPECT_EQ(static_cast<int>(Severity::Error), 2);
}

}  // namespace
}  // namespace lwr_fri_bridge
