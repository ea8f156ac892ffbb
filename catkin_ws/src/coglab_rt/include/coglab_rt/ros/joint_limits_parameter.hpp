/// @file
/// Reads the table of joint limits that two ROS parameters name.
#pragma once

#include <ros/node_handle.h>
#include <ros/package.h>

#include <stdexcept>
#include <string>

#include "coglab_rt/joint_limits_table.hpp"
#include "coglab_rt/ros/parameter.hpp"

namespace coglab_rt {

/// Reads the table.
/// @param file name of the parameter with its path; unset or empty: config/joint_limits.yaml of the
/// package `description`. A file may be wider than that table only if it declares this.
/// @param profile name of the parameter with the profile; unset: "default".
/// @throws std::invalid_argument naming the parameter, std::runtime_error naming file and line.
inline JointLimits readJointLimits(const ros::NodeHandle& node, const char* file,
                                   const char* profile, const std::string& description) {
  auto path = readParameter<std::string>(node, file, "", "a path");
  const std::string package = ros::package::getPath(description);
  const std::string own = package.empty() ? "" : package + "/config/joint_limits.yaml";
  if (path.empty()) {
    if (own.empty()) {
      throw std::runtime_error("package " + description +
                               " is not found; build and source the workspace or set " +
                               node.resolveName(file));
    }
    path = own;
  }
  return loadJointLimits(path, readParameter<std::string>(node, profile, "default", "a name"), own);
}

}  // namespace coglab_rt
