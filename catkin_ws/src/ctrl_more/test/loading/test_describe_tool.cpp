// The tool that writes pages and configurations: exit status and output.
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include <unistd.h>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

const std::string kTool = CTRL_MORE_DESCRIBE;
const std::string kLimits = CTRL_MORE_PLUGIN_DIR "/libctrl_more_joint_limits.so";
const std::string kGood = CTRL_MORE_TEST_PLUGIN_DIR "/libgood.so";  // has no texts

struct Result {
  int status = -1;
  std::string said;
};

// Runs the tool and returns its output; `also_errors` includes the error output.
Result run(const std::string& arguments, bool also_errors) {
  const std::string command = kTool + " " + arguments + (also_errors ? " 2>&1" : " 2>/dev/null");
  Result result;
  std::FILE* const pipe = popen(command.c_str(), "r");
  if (!pipe) return result;
  std::array<char, 4096> part{};
  while (const std::size_t n = std::fread(part.data(), 1, part.size(), pipe)) {
    result.said.append(part.data(), n);
  }
  const int state = pclose(pipe);
  if (WIFEXITED(state)) result.status = WEXITSTATUS(state);
  return result;
}

std::string contentOf(const std::string& path) {
  std::ifstream stream(path);
  std::stringstream text;
  text << stream.rdbuf();
  return text.str();
}

struct DescribeTool : ::testing::Test {
  void SetUp() override {
    ASSERT_EQ(access(kTool.c_str(), X_OK), 0) << "build " << kTool << ", which is tested";
  }
};

TEST_F(DescribeTool, PrintsThePageOrTheConfigurationAndNothingElse) {
  const Result page = run("page " + kLimits, true);
  EXPECT_EQ(page.status, 0);
  EXPECT_EQ(page.said.rfind("# JointLimits\n", 0), 0U) << page.said;
  const Result config = run("config " + kLimits, true);
  EXPECT_EQ(config.status, 0);
  EXPECT_EQ(config.said, contentOf(CTRL_MORE_SOURCE_DIR "/config/joint_limits.yaml"));
  const Result check = run("check " + kLimits, true);
  EXPECT_EQ(check.status, 0);
  EXPECT_EQ(check.said, "");
}

TEST_F(DescribeTool, OnlyTheCheckFailsForEmptyFields) {
  const Result check = run("check " + kGood, true);
  EXPECT_EQ(check.status, 1);
  EXPECT_TRUE(contains(check.said, "Good: summary")) << check.said;
  EXPECT_EQ(run("check " + kGood, false).said, "") << "that is an error";
  EXPECT_EQ(run("page " + kGood, true).status, 0);
  EXPECT_EQ(run("config " + kGood, true).status, 0);
}

TEST_F(DescribeTool, ALoadErrorIsPrintedWithStatusOne) {
  const Result missing = run("page /nowhere/libx.so", true);
  EXPECT_EQ(missing.status, 1);
  EXPECT_TRUE(contains(missing.said, "/nowhere/libx.so")) << missing.said;
  const Result list = run("list /nowhere/list.yaml", true);
  EXPECT_EQ(list.status, 1);
  EXPECT_TRUE(contains(list.said, "/nowhere/list.yaml:1: ")) << list.said;
}

TEST_F(DescribeTool, ListsWhatAFileLoads) {
  setenv("CTRL_MORE_PATH", CTRL_MORE_PLUGIN_DIR, 1);
  const Result list = run("list " CTRL_MORE_SOURCE_DIR "/config/feedback.yaml", true);
  unsetenv("CTRL_MORE_PATH");
  EXPECT_EQ(list.status, 0) << list.said;
  EXPECT_TRUE(contains(list.said, "ee_admittance (EeAdmittance, task stage)")) << list.said;
  EXPECT_TRUE(contains(list.said, "joint_limits (JointLimits, joint stage)")) << list.said;
}

}  // namespace
}  // namespace ctrl_more
