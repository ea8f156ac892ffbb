// Parameters of the manager and the plug-ins: each range of docs/reference.md at both ends and just
// beyond, with the words of its refusal; and what holds where nothing is named.
#include <cmath>
#include <fstream>
#include <sstream>

#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

struct Range {
  const char* name;
  double least, most;
};

std::string text(double value) {
  std::ostringstream out;
  out.precision(12);
  out << value;
  return out.str();
}

/// What a load of the plug-in says; empty if it is taken.
std::string loading(const std::string& id, const std::string& parameters) {
  VirtualRobot robot(parameters);
  const Answer answer =
      robot.manager->load(id, id == "ptp" ? "coglab/PtpController" : "coglab/DmpController");
  return answer.success ? "" : answer.message;
}

/// What a start of the manager says; empty if it is taken.
std::string starting(const std::string& parameters, bool lockstep = true) {
  try {
    VirtualRobot robot(parameters, 0.005, lockstep);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

/// Both ends are taken, and what is a little beyond them is refused with the range in words.
template <typename Says>
void expectRange(const Range& range, const std::string& where, Says&& says) {
  std::ostringstream words;
  words << "parameter " << where << range.name << ": expected a number from " << range.least
        << " to " << range.most << ", got ";
  for (const double end : {range.least, range.most}) {
    EXPECT_EQ(says(text(end)), "") << range.name << ": " << end;
    const double away = 1e-6 * std::max(std::abs(end), 1e-4);
    const std::string outside = text(end == range.least ? end - away : end + away);
    EXPECT_NE(says(outside).find(words.str() + outside), std::string::npos)
        << range.name << ": " << outside << ": " << says(outside);
  }
  for (const std::string wrong : {".nan", ".inf", "[1]", "fast"}) {
    EXPECT_NE(says(wrong).find(words.str()), std::string::npos) << range.name << ": " << wrong;
  }
}

TEST(ParameterRanges, OfDmp) {
  for (const Range& range : {Range{"pos_clik_gain", 0.0, 100.0},
                             Range{"rot_clik_gain", 0.0, 100.0},
                             Range{"correction_speed", 1e-3, 10.0},
                             Range{"hold_blend", 0.0, 5.0},
                             Range{"tolerance", 1e-5, 0.1},
                             Range{"arrive_distance", 1e-4, 0.5},
                             Range{"settle_time", 0.0, 60.0},
                             Range{"goal_max_age", 0.01, 10.0},
                             Range{"goal_max_jump", 0.01, 5.0},
                             Range{"goal_lost_time", 0.0, 60.0},
                             Range{"goal_timeout", 0.0, 3600.0},
                             Range{"goal_finish_distance", 0.0, 1.0},
                             Range{"goal_reach_margin", 0.0, 5.0},
                             Range{"max_initial_distance", 0.0, 1.0},
                             Range{"noisy_goal_time_constant", 0.005, 2.0},
                             Range{"noisy_goal_turning_time_constant", 0.005, 2.0},
                             Range{"noisy_goal_speed", 0.0, 1.0},
                             Range{"noisy_goal_turning", 0.0, 10.0},
                             Range{"predicted_goal_speed", 0.0, 1.0},
                             Range{"goal_max_speed", 0.01, 10.0},
                             Range{"goal_time_constant", 0.0, 2.0},
                             Range{"end_phase", 1e-6, 0.5},
                             Range{"end_speed", 1e-6, 1.0},
                             Range{"end_turning", 1e-6, 10.0},
                             Range{"end_distance", 1e-6, 0.5},
                             Range{"follow_distance", 1e-3, 1.0},
                             Range{"follow_time", 1e-6, 10.0},
                             Range{"singularity_threshold", 1e-6, 1.0}}) {
    expectRange(range, "dmp/", [&range](const std::string& value) {
      return loading("dmp", "{dmp: {" + std::string(range.name) + ": " + value + "}}");
    });
  }
  EXPECT_EQ(loading("dmp", "{dmp: {max_queue: 99}}"), "") << "it has no queue";
  for (const std::string flag : {"enable_ik_debug", "rotation_first_scaling"}) {
    EXPECT_NE(loading("dmp", "{dmp: {" + flag + ": 7}}").find("expected true or false, got 7"),
              std::string::npos);
  }
  EXPECT_NE(loading("dmp", "{dmp: {dmp_file: /nowhere.xml}}").find("/nowhere.xml:0"),
            std::string::npos);
  EXPECT_EQ(loading("dmp", "{dmp: {dmp_file: " PACKAGE_DIR "/config/primitives.xml}}"), "");
}

TEST(ParameterRanges, OfPointToPoint) {
  for (const Range& range :
       {Range{"Kp", 0.0, 100.0}, Range{"default_speed", 0.01, 1.0},
        Range{"default_acceleration", 0.01, 1.0}, Range{"tolerance", 1e-5, 0.1},
        Range{"settle_time", 0.0, 60.0}, Range{"hold_blend", 0.0, 5.0}}) {
    expectRange(range, "ptp/", [&range](const std::string& value) {
      return loading("ptp", "{ptp: {" + std::string(range.name) + ": " + value + "}}");
    });
  }
  for (const std::string fine : {"0", "64"}) {
    EXPECT_EQ(loading("ptp", "{ptp: {max_queue: " + fine + "}}"), "");
  }
  for (const std::string bad : {"-1", "65", "1.5"}) {
    EXPECT_NE(loading("ptp", "{ptp: {max_queue: " + bad + "}}")
                  .find("ptp/max_queue: expected a whole number from 0 to 64, got " + bad),
              std::string::npos);
  }
}

TEST(ParameterRanges, OfLoopGainsHangOnTheCycle) {
  // At most half a gain per cycle; and 200 and 100 where the cycle is quick.
  for (const auto& [cycle, pose, joints] :
       {std::tuple(0.02, 25.0, 25.0), std::tuple(0.002, 200.0, 100.0)}) {
    const std::string rest = "}, cycle_time: " + text(cycle) + "}";
    for (const auto& [id, name, most] :
         {std::tuple("dmp", "pos_clik_gain", pose), std::tuple("dmp", "rot_clik_gain", pose),
          std::tuple("ptp", "Kp", joints)}) {
      const std::string head = std::string("{") + id + ": {" + name + ": ";
      EXPECT_EQ(loading(id, head + text(most) + rest), "");
      EXPECT_NE(loading(id, head + text(most + 0.1) + rest).find("from 0 to " + text(most)),
                std::string::npos);
    }
  }
  EXPECT_EQ(loading("dmp", "{cycle_time: 0.1}"), "") << "the defaults shrink with it";
  EXPECT_EQ(loading("ptp", "{cycle_time: 0.1}"), "");
  EXPECT_EQ(largestGain(0.005), 100.0);
}

TEST(ParameterRanges, OfTheManager) {
  for (const Range& range :
       {Range{"cycle_time", 0.0005, 0.1}, Range{"sample_timeout", 0.005, 5.0},
        Range{"silent_time", 0.01, 10.0}, Range{"plan_timeout", 0.05, 30.0},
        Range{"speed_scale", 0.0, 1.0}, Range{"hand_speed_limit", 0.0, 5.0},
        Range{"elbow_speed_limit", 0.0, 5.0}, Range{"blocked_time", 0.05, 10.0},
        Range{"position_margin", 0.01, 0.5}}) {
    expectRange(range, "controller_manager/", [&range](const std::string& value) {
      return starting("{" + std::string(range.name) + ": " + value + "}");
    });
  }
  expectRange(Range{"overrun_time", 0.0, 10.0}, "controller_manager/",
              [](const std::string& v) { return starting("{overrun_time: " + v + "}", false); });
  EXPECT_EQ(starting("{overrun_time: -1}"), "") << "nothing is timed in lockstep";
  const std::string box = "box_min: [-9, -9, -9], box_max: [9, 9, 9], ";
  for (const Range& range : {Range{"base_radius", 0.0, 5.0}, Range{"max_stretch", 0.2, 1.0},
                             Range{"deceleration", 0.05, 20.0}}) {
    expectRange(range, "controller_manager/workspace/", [&](const std::string& value) {
      return starting("{workspace: {" + box + range.name + ": " + value + "}}");
    });
  }
  for (const std::string name : {"box_min", "box_max", "base_centre"}) {
    for (const std::string bad : {"[1, 2]", "[-1200, 1200, 1600]"}) {
      EXPECT_NE(starting("{workspace: {" + name + ": " + bad + "}}")
                    .find(name + ": expected 3 finite numbers"),
                std::string::npos);
    }
  }
  EXPECT_NE(starting("{workspace: 7}").find("workspace: expected a block"), std::string::npos);
  EXPECT_NE(starting("{plugin_paths: {a: b}}").find("expected a list of texts"), std::string::npos);
  EXPECT_NE(starting("{feedback_file: [a]}").find("feedback_file: expected a text"),
            std::string::npos);
}

TEST(ParameterRanges, LimitsOfJointsAreNarrowedJointByJoint) {
  const VirtualRobot robot;
  for (int joint = 0; joint < kMaxJoints; ++joint) {
    const auto with = [&](const char* name, const JointVector& table, double value) {
      JointVector values = table;
      values[joint] = value;
      std::ostringstream list;
      list.precision(17);
      for (int i = 0; i < kMaxJoints; ++i) list << (i > 0 ? ", " : "") << values[i];
      return starting("{" + std::string(name) + ": [" + list.str() + "]}");
    };
    const auto& table = robot.limits;
    const std::string refused = "joint " + std::to_string(joint + 1) + " is not inside";
    const double upper = table.upper_position[joint], lower = table.lower_position[joint];
    EXPECT_EQ(with("upper_joint_pos_limit", table.upper_position, upper - 1e-6), "");
    EXPECT_EQ(with("lower_joint_pos_limit", table.lower_position, lower + 1e-6), "");
    EXPECT_EQ(with("joint_vel_limit", table.velocity, 1e-6), "");
    for (const double bad : {upper + 1e-6, lower, lower - 0.1}) {
      EXPECT_NE(with("upper_joint_pos_limit", table.upper_position, bad).find(refused),
                std::string::npos);
    }
    for (const double bad : {lower - 1e-6, upper, upper + 0.1}) {
      EXPECT_NE(with("lower_joint_pos_limit", table.lower_position, bad).find(refused),
                std::string::npos);
    }
    for (const double bad : {0.0, -0.1, table.velocity[joint] + 1e-6}) {
      EXPECT_NE(with("joint_vel_limit", table.velocity, bad).find(refused), std::string::npos);
    }
  }
}

TEST(ParameterDefaults, OfTheManagerAreTheDocumentedOnes) {
  const VirtualRobot robot;
  const ManagerSettings& settings = robot.manager->settings();
  EXPECT_EQ(settings.plan_timeout, 0.3);  // of the virtual arm
  EXPECT_EQ(ManagerSettings().plan_timeout, 2.0);
  EXPECT_FALSE(ManagerSettings().lockstep);
  EXPECT_EQ(settings.cycle.cycle_time, 0.005);
  EXPECT_EQ(settings.cycle.sample_timeout, 0.1);
  EXPECT_EQ(settings.cycle.silent_time, 0.5);
  EXPECT_EQ(settings.cycle.blocked_time, 0.5);
  EXPECT_EQ(settings.cycle.overruns_to_fault, 5);
  EXPECT_EQ(CycleSettings().overrun_time, 0.004);
  EXPECT_EQ(robot.manager->report().speed_scale, 1.0);
  const RobotSetup& setup = *settings.robot;
  EXPECT_EQ(setup.guard.lower_position, robot.limits.lower_position);
  EXPECT_EQ(setup.guard.upper_position, robot.limits.upper_position);
  EXPECT_EQ(setup.guard.velocity, robot.limits.velocity);
  EXPECT_EQ(setup.guard.acceleration, robot.limits.acceleration);
  EXPECT_EQ(setup.guard.jerk, robot.limits.jerk);
  EXPECT_EQ(setup.guard.position_margin, robot.limits.position_margin);
  EXPECT_EQ(setup.guard.hand_speed, 1.0);
  EXPECT_EQ(setup.guard.elbow_speed, 1.0);
  EXPECT_EQ(setup.guard.workspace_deceleration, 2.0);
  EXPECT_FALSE(setup.tactile);
  EXPECT_NEAR(setup.tool_from_wrench.w(), 1.0, 1e-12) << "the wrench is that of the palm";
  EXPECT_TRUE(settings.feedback_file.empty());
  EXPECT_EQ(settings.types.at("coglab/DmpController"), "libcoglab_dmp_controller.so");
  EXPECT_EQ(settings.types.at("coglab/PtpController"), "libcoglab_ptp_controller.so");
  const ManagerSettings timed = readManagerSettings(
      YAML::Load("{cycle_time: 0.007, types: {a/B: liba.so, c: {D: libc.so}}}"),
      readText(std::string(DESCRIPTION_DIR) + "/urdf/lwr_ih2.urdf"), robot.limits, false);
  EXPECT_EQ(timed.cycle.overrun_time, 0.007) << "one cycle";
  EXPECT_EQ(timed.types.at("a/B"), "liba.so");
  EXPECT_EQ(timed.types.at("c/D"), "libc.so") << "a slash in a ROS name makes a block of it";
}

/// The file that is shipped says what holds without it, but for the names of predicted goals.
std::string shipped() {
  YAML::Node node = YAML::LoadFile(PACKAGE_DIR "/config/controllers.yaml");
  node.remove("feedback_file");
  node["dmp"].remove("predicted_goals");
  std::ostringstream out;
  out << node;
  return out.str();
}

/// docs/reference.md, where the file is silent.
const std::string kRest =
    "{dmp: {goal_reach_margin: 0.5, max_initial_distance: 0.1, end_phase: 0.012, arrive_distance: "
    "0.01, settle_time: 2.0, follow_distance: 0.03, follow_time: 0.2, hold_blend: 0.15, "
    "correction_speed: 0.3}, ptp: {tolerance: 0.002, settle_time: 2.0, hold_blend: 0.15}}";

class Twins : public ::testing::TestWithParam<std::string> {};

TEST_P(Twins, AReachAndAMotionWithTheDocumentedParametersAreThoseWithoutAny) {
  VirtualRobot one, other(GetParam());
  const auto both = [&](auto&& what) {
    what(one);
    what(other);
  };
  both([](VirtualRobot& robot) {
    robot.loadBoth();
    robot.followWithinLimits();
    robot.see("human_hand", Vector3(0.8, 0.0, 0.45));
    DmpRequest request = robot.reach();
    request.orientation_control = true;
    ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(request)));
  });
  for (int i = 0; i < 1500; ++i) {
    // Noise, then a goal that leaves for good; frames of 30 Hz; an arm that is pushed aside.
    const double t = i * 0.005, tremble = i % 14 < 7 ? 0.004 : -0.004;
    const Vector3 goal(0.8 + (t < 1.0 ? tremble : 0.0), t > 4.0 ? 0.06 : 0.0, 0.45);
    const Quaternion turned(Eigen::AngleAxisd(t < 1.0 ? 10.0 * tremble : 0.0, Vector3::UnitZ()));
    both([&](VirtualRobot& robot) {
      if (i % 7 == 0) robot.see("human_hand", goal, turned);
      if (i == 100) robot.sample.position[5] += 0.02;
      robot.tick();
    });
    ASSERT_EQ(one.command.velocity, other.command.velocity) << i << " " << one.reason();
    ASSERT_EQ(one.reason(), other.reason());
  }
  EXPECT_EQ(one.state(), MotionState::Reached) << one.reason();
  both([](VirtualRobot& robot) {
    robot.switchTo("ptp");
    std::vector<double> there(kHome.data(), kHome.data() + 7);
    there[0] += 1.0;
    for (int i = 0; i < 18; ++i) {
      const int status = robot.ptp().add({there, {}, {}}).status;
      EXPECT_EQ(status, i == 0   ? MotionAnswer::kStarted
                        : i < 17 ? MotionAnswer::kQueued
                                 : MotionAnswer::kRejected)
          << i;
    }
  });
  for (int i = 0; i < 200; ++i) {
    both([](VirtualRobot& robot) { robot.tick(); });
    ASSERT_EQ(one.command.velocity, other.command.velocity) << i;
  }
  const DmpController &first = one.dmp(), &second = other.dmp();
  EXPECT_EQ(first.ikDebug(), second.ikDebug());
  EXPECT_FALSE(first.ikDebug());
  EXPECT_EQ(first.dmpFrame(), "lwr_base_link");
  EXPECT_EQ(first.baseFrame(), second.baseFrame());
  EXPECT_EQ(first.goalTfFrame(), "dmp_goal");
}

INSTANTIATE_TEST_SUITE_P(ParameterDefaults, Twins, ::testing::Values(shipped(), kRest));

TEST(Parameters, AreReadWithTheirKindAndRefusedWithTheirName) {
  const Parameters block(YAML::Load("{n: 1.5, w: 3, f: true, t: word, l: [a, b], v: [1, 2, 3], "
                                    "nothing: , inner: {x: 2}, bad: [1, .nan, 3]}"),
                         "here");
  EXPECT_TRUE(block.has("n"));
  EXPECT_FALSE(block.has("m"));
  EXPECT_FALSE(block.has("nothing"));
  EXPECT_EQ(block.number("nothing", 7.0, 0.0, 1.0), 7.0);
  EXPECT_EQ(block.number("n", 7.0, 1.5, 1.5), 1.5);
  EXPECT_EQ(block.whole("w", 7, 3, 3), 3);
  EXPECT_EQ(block.whole("m", 7, 0, 1), 7);
  EXPECT_TRUE(block.flag("f", false));
  EXPECT_TRUE(block.flag("m", true));
  EXPECT_EQ(block.text("t", ""), "word");
  EXPECT_EQ(block.text("m", "other"), "other");
  EXPECT_EQ(block.texts("l"), (std::vector<std::string>{"a", "b"}));
  EXPECT_TRUE(block.texts("m").empty());
  EXPECT_EQ(block.numbers("v", Eigen::VectorXd::Zero(3)), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(block.numbers("m", Eigen::VectorXd::Ones(2)), Eigen::Vector2d(1, 1));
  EXPECT_EQ(block.block("inner").number("x", 0.0, 0.0, 9.0), 2.0);
  EXPECT_EQ(block.block("m").number("x", 5.0, 0.0, 9.0), 5.0);
  EXPECT_EQ(block.choice("t", "a", {"a", "word"}), "word");
  EXPECT_EQ(block.choice("m", "a", {"a", "word"}), "a");
  EXPECT_EQ(Parameters(YAML::Node(), "none").number("n", 4.0, 0.0, 1.0), 4.0);
  const auto refusal = [](auto&& read) -> std::string {
    try {
      read();
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal([&] { block.whole("w", 7, 4, 9); }),
            "parameter here/w: expected a whole number from 4 to 9, got 3");
  EXPECT_EQ(refusal([&] { block.whole("w", 7, 0, 2); }),
            "parameter here/w: expected a whole number from 0 to 2, got 3");
  EXPECT_EQ(refusal([&] { block.flag("t", true); }),
            "parameter here/t: expected true or false, got word");
  EXPECT_EQ(refusal([&] {
              block.choice("t", "a", {"a", "b"});
            }),
            "parameter here/t: expected a or b, got word");
  for (const char* name : {"bad", "l", "n"}) {
    EXPECT_NE(refusal([&] {
                block.numbers(name, Eigen::VectorXd::Zero(3));
              }).find(": expected 3 finite numbers"),
              std::string::npos);
  }
  EXPECT_NE(refusal([&] { block.numbers("v", Eigen::VectorXd::Zero(2)); }), "");
  EXPECT_NE(refusal([&] { block.texts("inner"); }).find("a list of texts"), std::string::npos);
  EXPECT_NE(refusal([&] { block.text("l", ""); }).find("expected a text"), std::string::npos);
  EXPECT_NE(refusal([] { Parameters(YAML::Load("[1]"), "x"); }), "");
  EXPECT_NE(refusal([&] { block.block("n"); }).find("here/n: expected a block"), std::string::npos);
}

}  // namespace
}  // namespace coglab_controllers
