// Parameters of the manager and the plug-ins: a value that cannot be used is refused with its name
// and what was expected. The ranges themselves are where each parameter is read.
#include <cmath>
#include <fstream>
#include <sstream>

#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

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

/// Numbers far out of any range and values that are no number are refused, with name, range and
/// value.
template <typename Says>
void expectRefusals(const std::string& where, Says&& says) {
  for (const std::string wrong : {"-1e9", "1e9", ".nan", ".inf", "[1]", "fast"}) {
    const std::string said = says(wrong);
    EXPECT_NE(said.find("parameter " + where + ": "), std::string::npos) << wrong << ": " << said;
    EXPECT_NE(said.find(" from "), std::string::npos) << wrong << ": " << said;
    EXPECT_NE(said.find(", got "), std::string::npos) << said;
  }
}

TEST(ParameterRanges, OfDmp) {
  for (const std::string name :
       {"correction_speed", "goal_max_jump", "noisy_goal_time_constant", "end_speed"}) {
    expectRefusals("dmp/" + name, [&name](const std::string& value) {
      return loading("dmp", "{dmp: {" + name + ": " + value + "}}");
    });
  }
  EXPECT_EQ(loading("dmp", "{dmp: {max_queue: 99}}"), "") << "it has no queue";
  for (const std::string flag : {"enable_ik_debug", "rotation_first_scaling"}) {
    const std::string said = loading("dmp", "{dmp: {" + flag + ": 7}}");
    EXPECT_NE(said.find("dmp/" + flag + ": "), std::string::npos) << said;
    EXPECT_NE(said.find("got 7"), std::string::npos) << said;
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
       {std::pair<std::string, std::string>{"elbow", "dmp/second_task: "},
        {"axis, axis: [0, 0, 0]", "dmp/axis: expected three"},
        {"axis, axis: [1, 0]", "dmp/axis: expected 3"},
        {"posture", "dmp/posture: expected seven"},
        {"posture, posture: [0, 0]", "dmp/posture: expected 7"},
        {"posture, posture: [0, 0, 0, 0, 0, 0, 0], posture_gain: 101", "dmp/posture_gain: "}}) {
    const std::string said = loading("dmp", "{dmp: {second_task: " + bad + "}}");
    EXPECT_NE(said.find(words), std::string::npos) << bad << ": " << said;
  }
}

TEST(ParameterRanges, OfPointToPoint) {
  for (const std::string name : {"Kp", "default_speed"}) {
    expectRefusals("ptp/" + name, [&name](const std::string& value) {
      return loading("ptp", "{ptp: {" + name + ": " + value + "}}");
    });
  }
  EXPECT_EQ(loading("ptp", "{ptp: {max_queue: 0}}"), "");
  for (const std::string bad : {"-1", "1.5"}) {
    EXPECT_NE(loading("ptp", "{ptp: {max_queue: " + bad + "}}").find("ptp/max_queue: "),
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
  for (const std::string name : {"cycle_time", "hand_speed_limit", "position_margin"}) {
    expectRefusals("controller_manager/" + name, [&name](const std::string& value) {
      return starting("{" + name + ": " + value + "}");
    });
  }
  for (const std::string name : {"base_radius", "max_stretch", "deceleration"}) {
    expectRefusals("controller_manager/workspace/" + name, [&name](const std::string& value) {
      return starting("{workspace: {" + name + ": " + value + "}}");
    });
  }
  for (const std::string name : {"box_min", "box_max", "base_centre"}) {
    for (const std::string bad : {"[1, 2]", "[-1200, 1200, 1600]"}) {
      EXPECT_NE(starting("{workspace: {" + name + ": " + bad + "}}").find(name + ": expected 3"),
                std::string::npos);
    }
  }
  EXPECT_NE(starting("{workspace: 7}").find("workspace: "), std::string::npos);
  EXPECT_NE(starting("{plugin_paths: {a: b}}").find("plugin_paths: "), std::string::npos);
  EXPECT_NE(starting("{feedback_file: [a]}").find("feedback_file: "), std::string::npos);
}

}  // namespace
}  // namespace coglab_controllers
