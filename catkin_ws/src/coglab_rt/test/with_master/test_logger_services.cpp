/// The services ~get_loggers and ~set_logger_level: loggers and levels, effect of a level, refused
/// requests and how often they are logged.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include <ros/console.h>
#include <ros/node_handle.h>
#include <ros/service.h>

#include "coglab_rt/ros/logger_service.hpp"

namespace coglab_rt {
namespace {

class Loggers : public ::testing::Test {
 protected:
  void TearDown() override { set("ros", "info"); }

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

TEST_F(Loggers, AnUnknownLoggerOrLevelChangesNothing) {
  const auto before = levels();
  EXPECT_FALSE(set("ros", "loud"));
  EXPECT_FALSE(set("ros", ""));
  EXPECT_FALSE(set("ros.nobody", "debug"));
  EXPECT_FALSE(set("", "debug"));
  EXPECT_EQ(levels(), before);
}

}  // namespace
}  // namespace coglab_rt
