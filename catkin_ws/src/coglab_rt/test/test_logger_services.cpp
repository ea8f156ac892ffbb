/// The services ~get_loggers and ~set_logger_level: which loggers and levels there are, what a
/// level does, what is refused and how often that is said.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include <ros/console.h>
#include <ros/node_handle.h>
#include <ros/service.h>

#include "coglab_rt/ros/logger_service.hpp"
#include "own_master.hpp"

namespace coglab_rt {
namespace {

/// Refusals are told by ROS time, which stands still here and is set. It never goes back, because
/// the line that tells them remembers when it did so last.
class Loggers : public ::testing::Test {
 protected:
  void SetUp() override {
    ros::Time::init();
    pass(100.0);
  }
  void TearDown() override { set("ros", "info"); }

  static void pass(double seconds) {
    static ros::Time now(1000.0);
    now += ros::Duration(seconds);
    ros::Time::setNow(now);
  }
  static bool set(const std::string& logger, const std::string& level) {
    roscpp::SetLoggerLevel call;
    call.request.logger = logger;
    call.request.level = level;
    return ros::service::call("~set_logger_level", call);
  }
  /// Levels by the names of their loggers, as the service tells them.
  static std::map<std::string, std::string> levels() {
    roscpp::GetLoggers call;
    EXPECT_TRUE(ros::service::call("~get_loggers", call));
    std::map<std::string, std::string> found;
    for (const auto& logger : call.response.loggers) found[logger.name] = logger.level;
    EXPECT_EQ(found.size(), call.response.loggers.size());
    return found;
  }

  const std::string own_ = ROSCONSOLE_DEFAULT_NAME;
  LoggerServices services_;
};

TEST_F(Loggers, ThereAreTwoAndBothBeginWithInfo) {
  EXPECT_EQ(levels(), (std::map<std::string, std::string>{{"ros", "info"}, {own_, "info"}}));
}

TEST_F(Loggers, EveryLevelIsTakenInSmallAndInLargeLettersAndTold) {
  for (const char* level :
       {"debug", "info", "warn", "error", "fatal", "DEBUG", "INFO", "WARN", "ERROR", "FATAL"}) {
    EXPECT_TRUE(set("ros", level)) << level;
    EXPECT_EQ(levels()["ros"], level);
    EXPECT_EQ(levels()[own_], "info");
  }
}

TEST_F(Loggers, ALevelDecidesAtOnceWhatIsLogged) {
  const auto logged = [](auto log) {
    ::testing::internal::CaptureStderr();
    log();
    return !::testing::internal::GetCapturedStderr().empty();
  };
  const auto warn = [] { ROS_WARN("a warning"); };
  const auto error = [] { ROS_ERROR("an error"); };
  EXPECT_TRUE(logged(warn));
  ASSERT_TRUE(set(own_, "error"));
  EXPECT_FALSE(logged(warn));
  EXPECT_TRUE(logged(error));
  ASSERT_TRUE(set(own_, "fatal"));
  EXPECT_FALSE(logged(error));
  ASSERT_TRUE(set(own_, "info"));
  EXPECT_TRUE(logged(warn));
}

TEST_F(Loggers, WhatIsNoLoggerOrNoLevelChangesNothing) {
  const auto before = levels();
  EXPECT_FALSE(set("ros", "loud"));
  EXPECT_FALSE(set("ros", ""));
  EXPECT_FALSE(set("ros.nobody", "debug"));
  EXPECT_FALSE(set("", "debug"));
  EXPECT_EQ(levels(), before);
}

TEST_F(Loggers, ARefusalSaysWhatIsExpectedOnceASecond) {
  const auto told = [] {
    ::testing::internal::CaptureStderr();
    set("ros", "loud");
    return ::testing::internal::GetCapturedStderr().find(
               "set_logger_level refused: expected a logger of ~get_loggers and one of debug, "
               "info, warn, error, fatal") != std::string::npos;
  };
  EXPECT_TRUE(told());
  pass(0.75);
  EXPECT_FALSE(told());
  pass(0.5);
  EXPECT_TRUE(told());
}

}  // namespace
}  // namespace coglab_rt

int main(int count, char** words) {
  return coglab_rt::runWithOwnMaster(count, words, "logger_services_test");
}
