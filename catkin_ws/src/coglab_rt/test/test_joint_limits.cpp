/// The table of joint limits: what is read, and what is said when it cannot be.
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include <unistd.h>

#include "coglab_rt/joint_limits_table.hpp"

namespace coglab_rt {
namespace {

std::string original() {
  std::ifstream file(LIMITS_FILE);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string errorFor(const std::string& text, const std::string& profile = "default") {
  char path[] = "/tmp/joint_limits_XXXXXX";
  const int fd = mkstemp(path);
  EXPECT_EQ(write(fd, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  close(fd);
  std::string error;
  try {
    loadJointLimits(path, profile);
  } catch (const std::runtime_error& caught) {
    error = caught.what();
  }
  std::remove(path);
  return error;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(JointLimits, ReadsTheTableAndItsProfiles) {
  const JointLimits full = loadJointLimits(LIMITS_FILE);
  EXPECT_NEAR(full.upper_position[0], 2.9670597, 1e-6);
  EXPECT_NEAR(full.lower_position[1], -2.0943951, 1e-6);
  EXPECT_DOUBLE_EQ(full.torque[6], 38.0);
  const JointLimits t1 = loadJointLimits(LIMITS_FILE, "t1");
  // What is commanded leaves the servos room to pass it.
  EXPECT_DOUBLE_EQ(t1.velocity[0], 0.24 / 1.04);
  EXPECT_DOUBLE_EQ(full.velocity[0], 1.919862177193763 / 1.04);
  EXPECT_EQ(t1.upper_position, full.upper_position);
}

TEST(JointLimits, ATableWithoutServoOvershootIsCommandedInFull) {
  EXPECT_EQ(errorFor(replaced(original(), "servo_overshoot: 0.04", "")), "");
  for (const char* bad : {"-0.1", "0.6", "much", ".nan", "[0.04]"}) {
    const std::string error =
        errorFor(replaced(original(), "overshoot: 0.04", std::string("overshoot: ") + bad));
    EXPECT_NE(error.find("servo_overshoot: expected a number in 0..0.5"), std::string::npos) << bad;
  }
}

TEST(JointLimits, ErrorsNameFileLineAndField) {
  EXPECT_EQ(errorFor(original()), "");
  EXPECT_NE(errorFor(original(), "t3").find("profile 't3' is missing"), std::string::npos);
  const std::string short_list = errorFor(replaced(original(), "torque: [176.0, ", "torque: ["));
  EXPECT_NE(short_list.find("default.torque: expected a list of 7 numbers, got 6"),
            std::string::npos)
      << short_list;
  EXPECT_NE(short_list.find("/tmp/joint_limits_"), std::string::npos);
  EXPECT_NE(errorFor(replaced(original(), "jerk: [500.0", "jerk: [.nan")).find("default.jerk[0]"),
            std::string::npos);
  EXPECT_NE(errorFor(replaced(original(), "jerk: [500.0", "jerk: [-5.0")).find("positive"),
            std::string::npos);
  EXPECT_NE(errorFor(replaced(original(), "jerk: [500.0", "jerk: [fast")).find("expected a number"),
            std::string::npos);
  EXPECT_NE(errorFor(replaced(original(), "lwr_a2", "lwr_a1"))
                .find("joints[1] = 'lwr_a1': expected a name that no other joint has"),
            std::string::npos);
  EXPECT_NE(errorFor(replaced(original(), "[lwr_a1, ", "[")).find("joints: expected the 7 names"),
            std::string::npos);
  EXPECT_NE(
      errorFor(replaced(original(), "  torque:", "  torq:")).find("default.torq: unknown field"),
      std::string::npos);
  EXPECT_NE(errorFor(replaced(original(), "lower_position: [-2.96", "lower_position: [3.96"))
                .find("lower_position must be below"),
            std::string::npos);
  EXPECT_NE(errorFor(replaced(original(), "position_margin: 0.01", "position_margin: wide"))
                .find("position_margin: expected a number from 0 to 0.5"),
            std::string::npos);
  EXPECT_NE(errorFor(replaced(original(), "position_margin: 0.01\n", "")).find("position_margin"),
            std::string::npos);
  EXPECT_NE(errorFor("joints: [").size(), 0U);
  EXPECT_NE(errorFor("").size(), 0U);
  EXPECT_THROW(loadJointLimits("/nonexistent.yaml"), std::runtime_error);
}

}  // namespace
}  // namespace coglab_rt
