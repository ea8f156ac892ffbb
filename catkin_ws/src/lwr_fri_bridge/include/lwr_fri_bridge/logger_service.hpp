/// @file
/// The service ~set_logger_level of roscpp, for requests of any content.
#pragma once

#include <map>
#include <string>

#include <ros/console.h>
#include <ros/ros.h>
#include <ros/service_manager.h>
#include <roscpp/SetLoggerLevel.h>

namespace lwr_fri_bridge {

/// Sets the level (debug, info, warn, error, fatal, in small letters or capitals) of a logger that
/// ~get_loggers lists; anything else is refused.
inline bool setLoggerLevel(roscpp::SetLoggerLevel::Request& request,
                           roscpp::SetLoggerLevel::Response&) {
  using namespace ros::console::levels;
  static const std::map<std::string, Level> kLevels = {
      {"debug", Debug}, {"info", Info}, {"warn", Warn}, {"error", Error}, {"fatal", Fatal},
      {"DEBUG", Debug}, {"INFO", Info}, {"WARN", Warn}, {"ERROR", Error}, {"FATAL", Fatal}};
  const auto level = kLevels.find(request.level);
  std::map<std::string, Level> loggers;
  if (level == kLevels.end() || !ros::console::get_loggers(loggers) ||
      loggers.count(request.logger) == 0 ||
      !ros::console::set_logger_level(request.logger, level->second)) {
    ROS_WARN_THROTTLE(1.0,
                      "set_logger_level refused: expected a logger of ~get_loggers and one of "
                      "debug, info, warn, error, fatal");
    return false;
  }
  ros::console::notifyLoggerLevelsChanged();
  return true;
}

/// Puts setLoggerLevel() in the place of roscpp's own, which ends the process on some names. Call
/// it once; the service lives as long as what is returned.
inline ros::ServiceServer guardLoggerService() {
  ros::NodeHandle node("~");  // starts roscpp, which advertises its own, if nothing has yet
  ros::ServiceManager::instance()->unadvertiseService(node.resolveName("set_logger_level"));
  return node.advertiseService("set_logger_level", &setLoggerLevel);
}

}  // namespace lwr_fri_bridge
