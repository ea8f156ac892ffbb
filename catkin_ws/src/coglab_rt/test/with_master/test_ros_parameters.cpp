/// Reading from the parameter server: values of each type, ranges and their ends, trees, the table
/// of joint limits, and the messages for invalid values.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <ros/node_handle.h>
#include <ros/param.h>
#include <unistd.h>

#include "coglab_rt/ros/joint_limits_parameter.hpp"
#include "coglab_rt/ros/parameter.hpp"
#include "coglab_rt/ros/parameter_tree.hpp"

namespace coglab_rt {
namespace {

/// Message of the exception of `read`; empty if it throws none.
template <typename Error = std::invalid_argument>
std::string refusal(const std::function<void()>& read) {
  try {
    read();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

/// Each test has the parameters below /test for itself.
class RosParameters : public ::testing::Test {
 protected:
  void TearDown() override { ros::param::del("/test"); }

  ros::NodeHandle node_{"/test"};
};

TEST_F(RosParameters, AValueOfItsTypeIsReadAndNoneIsTheDefault) {
  node_.setParam("word", std::string("arm"));
  node_.setParam("count", 3);
  node_.setParam("half", 0.5);
  node_.setParam("off", false);
  EXPECT_EQ(readParameter<std::string>(node_, "word", "none", "a name"), "arm");
  EXPECT_EQ(readParameter<int>(node_, "count", 7, "a whole number"), 3);
  EXPECT_EQ(readParameter<double>(node_, "half", 7.0, "a number"), 0.5);
  EXPECT_EQ(readParameter<double>(node_, "count", 7.0, "a number"), 3.0);  // a whole one is one
  EXPECT_FALSE(readParameter<bool>(node_, "off", true, "true or false"));
  EXPECT_EQ(readParameter<int>(node_, "missing", 7, "a whole number"), 7);
  EXPECT_TRUE(readParameter<bool>(node_, "missing", true, "true or false"));
}

TEST_F(RosParameters, AnotherTypeIsAnErrorAndNotTheDefault) {
  node_.setParam("word", std::string("3"));
  node_.setParam("list", std::vector<double>{1.0});
  const auto number = [&] { readParameter<double>(node_, "word", 1.0, "a number of seconds"); };
  EXPECT_NE(refusal(number).find("/test/word"), std::string::npos);
  const auto flag = [&] { readParameter<bool>(node_, "list", true, "true or false"); };
  EXPECT_NE(refusal(flag).find("/test/list"), std::string::npos);
}

TEST_F(RosParameters, TheNearestNamespaceAboveTheNodeCounts) {
  const ros::NodeHandle below("/test/inner/deep");
  EXPECT_EQ(readNearest<int>(below, "port", 5, "a whole number"), 5);
  node_.setParam("port", 1);
  EXPECT_EQ(readNearest<int>(below, "port", 5, "a whole number"), 1);
  node_.setParam("inner/port", 2);
  EXPECT_EQ(readNearest<int>(below, "port", 5, "a whole number"), 2);
  node_.setParam("inner/port", std::string("two"));
  const auto read = [&] { readNearest<int>(below, "port", 5, "a whole number"); };
  EXPECT_NE(refusal(read).find("/test/inner/port"), std::string::npos);
}

TEST_F(RosParameters, BothEndsOfARangeBelongToIt) {
  for (const double value : {-0.5, 0.0, 2.5}) {
    node_.setParam("x", value);
    EXPECT_EQ(readNumber(node_, "x", 1.0, -0.5, 2.5), value);
  }
  EXPECT_EQ(readNumber(node_, "missing", 1.0, -0.5, 2.5), 1.0);
  for (const double value : {std::nextafter(-0.5, -1.0), std::nextafter(2.5, 3.0),
                             std::numeric_limits<double>::infinity(), std::nan("")}) {
    node_.setParam("x", value);
    EXPECT_THROW(readNumber(node_, "x", 1.0, -0.5, 2.5), std::invalid_argument) << value;
  }
  // A default is checked like a set value.
  EXPECT_THROW(readNumber(node_, "missing", 3.0, -0.5, 2.5), std::invalid_argument);
}

TEST_F(RosParameters, ATreeHasEveryTypeThatYamlSupports) {
  node_.setParam("flag", true);
  node_.setParam("count", -3);
  node_.setParam("half", 0.5);
  node_.setParam("word", std::string("arm"));
  node_.setParam("list", std::vector<int>{4, 5, 6});
  node_.setParam("inner/deep/value", 8);
  for (const ros::NodeHandle& node : {node_, ros::NodeHandle(node_, "")}) {
    const YAML::Node tree = readParameterTree(node);
    ASSERT_TRUE(tree.IsMap());
    EXPECT_EQ(tree.size(), 6U);
    EXPECT_EQ(tree["flag"].as<std::string>(), "true");
    EXPECT_EQ(tree["count"].as<std::string>(), "-3");
    EXPECT_EQ(tree["half"].as<double>(), 0.5);
    EXPECT_EQ(tree["word"].as<std::string>(), "arm");
    EXPECT_EQ(tree["list"].as<std::vector<int>>(), (std::vector<int>{4, 5, 6}));
    EXPECT_EQ(tree["inner"]["deep"]["value"].as<int>(), 8);
  }
}

/// A table in a file that one parameter names, and its profile, which another one names.
class LimitsParameters : public RosParameters {
 protected:
  void SetUp() override {
    std::ifstream original(LIMITS_FILE);
    std::string text((std::istreambuf_iterator<char>(original)), std::istreambuf_iterator<char>());
    const std::string margin = "position_margin: 0.01";
    text.replace(text.find(margin), margin.size(), "position_margin: 0.03");
    std::ofstream(path_) << text;
  }
  void TearDown() override {
    unlink(path_.c_str());
    RosParameters::TearDown();
  }
  JointLimits limits(const std::string& description = "lwr_description") const {
    return readJointLimits(node_, "limits/file", "limits/profile", description);
  }

  const std::string path_ = "/tmp/coglab_rt_limits_" + std::to_string(getpid()) + ".yaml";
};

TEST_F(LimitsParameters, WithoutAFileTheDescriptionOfTheArmHasTheTable) {
  const JointLimits table = loadJointLimits(LIMITS_FILE);
  EXPECT_EQ(limits().velocity, table.velocity);
  EXPECT_EQ(limits().position_margin, 0.01);
  node_.setParam("limits/file", std::string(""));
  EXPECT_EQ(limits().velocity, table.velocity);
  node_.setParam("limits/profile", std::string("t1"));
  EXPECT_EQ(limits().velocity, loadJointLimits(LIMITS_FILE, "t1").velocity);
}

TEST_F(LimitsParameters, AFileIsReadInsteadWhateverTheDescription) {
  node_.setParam("limits/file", path_);
  EXPECT_EQ(limits("no_such_package").position_margin, 0.03);
  node_.setParam("limits/profile", std::string("fast"));
  const std::string text = refusal<std::runtime_error>([&] { limits(); });
  EXPECT_NE(text.find(path_), std::string::npos) << text;
  EXPECT_NE(text.find("profile 'fast' is missing"), std::string::npos) << text;
}

}  // namespace
}  // namespace coglab_rt
