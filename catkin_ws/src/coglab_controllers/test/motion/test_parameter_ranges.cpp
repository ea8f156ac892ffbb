// Parameters of the manager and the plug-ins: both ends of each range of config/controllers.yaml, and
// values just beyond with the error message.
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

/// Error message of loading the plug-in; empty if it is accepted.
std::string loading(const std::string& id, const std::string& parameters) {
  VirtualRobot robot(parameters);
  const Answer answer =
      robot.manager->load(id, id == "ptp" ? "coglab/PtpController" : "coglab/DmpController");
  return answer.success ? "" : answer.message;
}

/// Error message of starting the manager; empty if it is accepted.
std::string starting(const std::string& parameters) {
  try {
    VirtualRobot robot(parameters);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

/// Both ends are accepted. Values just beyond them are refused with the range in the message.
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
  for (const Range& range :
       {Range{"correction_speed", 1e-3, 10.0}, Range{"goal_max_jump", 0.01, 5.0},
        Range{"noisy_goal_time_constant", 0.005, 2.0}, Range{"end_speed", 1e-6, 1.0}}) {
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

TEST(ParameterRanges, OfTheSecondTask) {
  for (const std::string fine :
       {"orientation", "axis", "none", "axis, axis: [0, 0, 1]",
        "posture, posture: [0, 0.5, 0.8, -1.2, 0, 0.8, 0.5], posture_gain: 2.0"}) {
    EXPECT_EQ(loading("dmp", "{dmp: {second_task: " + fine + "}}"), "") << fine;
  }
  for (const auto& [bad, words] :
       {std::pair<std::string, std::string>{
            "elbow", "dmp/second_task: expected orientation or axis or posture or none, got elbow"},
        {"axis, axis: [0, 0, 0]", "dmp/axis: expected three numbers that are not all zero"},
        {"axis, axis: [1, 0]", "dmp/axis: expected 3 finite numbers"},
        {"posture", "dmp/posture: expected seven joint positions (rad)"},
        {"posture, posture: [0, 0]", "dmp/posture: expected 7 finite numbers"},
        {"posture, posture: [0, 0, 0, 0, 0, 0, 0], posture_gain: 101", "dmp/posture_gain: "}}) {
    const std::string said = loading("dmp", "{dmp: {second_task: " + bad + "}}");
    EXPECT_NE(said.find(words), std::string::npos) << bad << ": " << said;
  }
}

TEST(ParameterRanges, OfPointToPoint) {
  for (const Range& range : {Range{"Kp", 0.0, 100.0}, Range{"default_speed", 0.01, 1.0}}) {
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

TEST(ParameterRanges, OfLoopGainsDependOnTheCycle) {
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
  for (const Range& range : {Range{"cycle_time", 0.0005, 0.1}, Range{"hand_speed_limit", 0.0, 5.0},
                             Range{"position_margin", 0.01, 0.5}}) {
    expectRange(range, "controller_manager/", [&range](const std::string& value) {
      return starting("{" + std::string(range.name) + ": " + value + "}");
    });
  }
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

}  // namespace
}  // namespace coglab_controllers
