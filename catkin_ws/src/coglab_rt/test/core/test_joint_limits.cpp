/// The table of joint limits: its values, their ranges, and refused tables.
#include <gtest/gtest.h>

#include <unistd.h>
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>

#include "coglab_rt/joint_limits_table.hpp"

namespace coglab_rt {
namespace {

const std::string kNames = "joints: [j1, j2, j3, j4, j5, j6, j7]\n";  // line 1
const std::string kMargin = "position_margin: 0.02\n";                // line 2
const std::string kDefault =                                          // lines 3 to 9
    "default:\n"
    "  lower_position: [-1, -2, -3, -4, -5, -6, -6.2]\n"
    "  upper_position: [1, 2, 3, 4, 5, 6, 6.2]\n"
    "  velocity: [1, 2, 3, 4, 5, 6, 7]\n"
    "  acceleration: [11, 12, 13, 14, 15, 16, 17]\n"
    "  jerk: [21, 22, 23, 24, 25, 26, 27]\n"
    "  torque: [31, 32, 33, 34, 35, 36, 37]\n";
const std::string kTable = kNames + kMargin + kDefault;

std::string with(const std::string& from, const std::string& to) {
  std::string text = kTable;
  EXPECT_NE(text.find(from), std::string::npos) << from;
  return text.replace(text.find(from), from.size(), to);
}

/// A table in a file that lasts as long as the test.
class Edges : public ::testing::Test {
 protected:
  void TearDown() override { std::remove(path_.c_str()); }

  JointLimits load(const std::string& text, const std::string& profile = "default") const {
    std::ofstream(path_) << text;
    return loadJointLimits(path_, profile);
  }
  /// Error message after the file name; empty if the table is read.
  std::string error(const std::string& text, const std::string& profile = "default") const {
    try {
      load(text, profile);
    } catch (const std::runtime_error& caught) {
      const std::string begin = "joint limits " + path_, what = caught.what();
      return what.compare(0, begin.size(), begin) == 0 ? what.substr(begin.size()) : "?" + what;
    }
    return "";
  }

  const std::string path_ = "/tmp/coglab_rt_edges_" + std::to_string(getpid()) + ".yaml";
};

TEST_F(Edges, AFaultIsNamedWithFileLineAndField) {
  const char* const faults[][3] = {
      {"torque: [31, ", "torque: [", ":9: default.torque: "},
      {"[21, 22, 23, 24, 25, 26, 27]", "21", ":8: default.jerk: "},
      {"jerk: [21", "jerk: [.nan", ":8: default.jerk[0]"},
      {"jerk: [21", "jerk: [-5", "positive"},
      {"jerk: [21", "jerk: [fast", "expected a number"},
      {"velocity: [1,", "velocity: [0,", "positive"},
      {"j2", "j1", ":1: joints[1]"},
      {"[j1, ", "[", ":1: joints: "},
      {"  torque:", "  torq:", "default.torq: unknown field"},
      {"lower_position: [-1,", "lower_position: [1,", "lower_position must be below"},
      {"margin: 0.02", "margin: wide", ":2: position_margin: "},
      {"margin: 0.02", "margin: 0.501", "0 to 0.5"},
      {"position_margin: 0.02\n", "", "position_margin"},
      {"default:", "slow:", "profile 'default' is missing"}};
  for (const auto& [from, to, words] : faults)
    EXPECT_NE(error(with(from, to)).find(words), std::string::npos) << error(with(from, to));
  EXPECT_NE(error(kTable + "servo_overshoot: 0.6\n").find(":10: servo_overshoot"),
            std::string::npos);
  EXPECT_NE(error(kTable, "t3").find("profile 't3' is missing"), std::string::npos);
  EXPECT_NE(error("joints: ["), "");
  EXPECT_NE(error(""), "");
  EXPECT_THROW(loadJointLimits("/nonexistent.yaml"), std::runtime_error);
}

TEST_F(Edges, EveryValueComesToItsPlace) {
  const JointLimits limits = load(kTable);
  for (int i = 0; i < 7; ++i) {
    EXPECT_EQ(limits.names[static_cast<std::size_t>(i)], "j" + std::to_string(i + 1));
    EXPECT_EQ(limits.lower_position[i], -std::min(1.0 + i, 6.2));
    EXPECT_EQ(limits.upper_position[i], std::min(1.0 + i, 6.2));
    EXPECT_EQ(limits.velocity[i], 1.0 + i);
    EXPECT_EQ(limits.acceleration[i], 11.0 + i);
    EXPECT_EQ(limits.jerk[i], 21.0 + i);
    EXPECT_EQ(limits.torque[i], 31.0 + i);
  }
  EXPECT_EQ(limits.position_margin, 0.02);
}

TEST_F(Edges, ValuesInDegreesAreRefused) {
  for (const auto& [field, value] : {std::pair("lower_position: [-1,", "lower_position: [-170,"),
                                     {"upper_position: [1,", "upper_position: [170,"},
                                     {"velocity: [1,", "velocity: [110,"},
                                     {"acceleration: [11,", "acceleration: [570,"},
                                     {"jerk: [21,", "jerk: [28648,"}}) {
    EXPECT_NE(error(with(field, value)).find("degrees"), std::string::npos) << value;
  }
}

TEST_F(Edges, AFileMayBeWiderThanTheRobotOnlyIfItDeclaresThis) {
  const std::string own = path_ + "_own";
  std::ofstream(own) << kTable;
  const auto wider = [&](const std::string& text) {
    std::ofstream(path_) << text;
    try {
      loadJointLimits(path_, "default", own);
    } catch (const std::runtime_error& caught) {
      return std::string(caught.what());
    }
    return std::string();
  };
  EXPECT_EQ(wider(kTable), "");
  EXPECT_EQ(wider(with("upper_position: [1,", "upper_position: [0.9,")), "");
  for (const auto& [field, value] : {std::pair("upper_position: [1,", "upper_position: [1.1,"),
                                     {"lower_position: [-1,", "lower_position: [-1.1,"},
                                     {"velocity: [1,", "velocity: [1.1,"},
                                     {"torque: [31,", "torque: [32,"},
                                     {"position_margin: 0.02", "position_margin: 0.01"}}) {
    EXPECT_NE(wider(with(field, value)).find("is wider"), std::string::npos) << value;
    EXPECT_EQ(wider(with(field, value) + "wider_than_robot: true\n"), "") << value;
  }
  EXPECT_NE(wider(kTable + "wider_than_robot: perhaps\n").find("true or false"), std::string::npos);
  std::remove(own.c_str());
}

TEST_F(Edges, AProfileOverridesOnlyItsOwnValues) {
  const std::string slow = kTable + "slow:\n  velocity: [0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.2]\n";
  const JointLimits limits = load(slow, "slow");
  EXPECT_EQ(limits.velocity[0], 0.1);
  EXPECT_EQ(limits.velocity[6], 0.2);
  EXPECT_EQ(limits.acceleration, load(kTable).acceleration);
  EXPECT_EQ(load(slow).velocity[0], 1.0);
  EXPECT_EQ(error(slow + "  speed: 1\n", "slow"), ":12: slow.speed: unknown field");
  EXPECT_EQ(error(slow + "  speed: 1\n"), "");  // nobody asked for it
  EXPECT_EQ(error(kTable + "slow: 5\n", "slow"), ":1: profile 'slow' is missing");
}

}  // namespace
}  // namespace coglab_rt
