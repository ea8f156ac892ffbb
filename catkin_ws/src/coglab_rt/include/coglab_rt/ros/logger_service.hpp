/// @file
/// The services ~get_loggers and ~set_logger_level of roscpp, safe for any call at any time.
///
/// rosconsole of Debian 12 (1.14.3 with log4cxx 1.0.0) frees the list of loggers in each
/// get_loggers(). The next log message then ends the process. So this code never requests that
/// list.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <ros/callback_queue.h>
#include <ros/console.h>
#include <ros/ros.h>
#include <ros/service_manager.h>
#include <roscpp/GetLoggers.h>
#include <roscpp/SetLoggerLevel.h>

namespace coglab_rt {

/// The two services, with a table of the loggers of a node: `ros` and that of its package.
class LoggerServices {
 public:
  /// Replaces roscpp's own services during the life of this object.
  LoggerServices() : node_("~") {
    node_.setCallbackQueue(&queue_);
    for (const char* name : {"get_loggers", "set_logger_level"}) {
      ros::ServiceManager::instance()->unadvertiseService(node_.resolveName(name));
    }
    services_ = {node_.advertiseService("get_loggers", &LoggerServices::onGet, this),
                 node_.advertiseService("set_logger_level", &LoggerServices::onSet, this)};
    spinner_.start();
  }
  ~LoggerServices() { spinner_.stop(); }

 private:
  bool onGet(roscpp::GetLoggers::Request&, roscpp::GetLoggers::Response& response) {
    for (const auto& [name, level] : levels_) {
      roscpp::Logger logger;
      logger.name = name;
      logger.level = level;
      response.loggers.push_back(logger);
    }
    return true;
  }

  bool onSet(roscpp::SetLoggerLevel::Request& request, roscpp::SetLoggerLevel::Response&) {
    using namespace ros::console::levels;
    static const std::map<std::string, Level> kLevels = {
        {"debug", Debug}, {"info", Info}, {"warn", Warn}, {"error", Error}, {"fatal", Fatal},
        {"DEBUG", Debug}, {"INFO", Info}, {"WARN", Warn}, {"ERROR", Error}, {"FATAL", Fatal}};
    const auto level = kLevels.find(request.level);
    const auto logger = levels_.find(request.logger);
    if (level == kLevels.end() || logger == levels_.end() ||
        !ros::console::set_logger_level(request.logger, level->second)) {
      ROS_WARN_THROTTLE(1.0,
                        "set_logger_level refused: expected a logger of ~get_loggers and one of "
                        "debug, info, warn, error, fatal");
      return false;
    }
    logger->second = request.level;
    ros::console::notifyLoggerLevelsChanged();
    return true;
  }

  ros::CallbackQueue queue_;  // separate, so that the levels can be set while the node is busy
  ros::AsyncSpinner spinner_{1, &queue_};
  ros::NodeHandle node_;
  std::map<std::string, std::string> levels_{{ROSCONSOLE_ROOT_LOGGER_NAME, "info"},
                                             {ROSCONSOLE_DEFAULT_NAME, "info"}};
  std::vector<ros::ServiceServer> services_;
};

}  // namespace coglab_rt
