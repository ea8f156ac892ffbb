/// @file
/// Checked reading of parameters from ROS or from a YAML file.
#pragma once

#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "coglab_controllers/kinematics/types.hpp"

namespace coglab_controllers {

/// One block of parameters. Every read has a default and a range. An invalid value throws
/// std::runtime_error: "parameter <block>/<name>: expected …, got …". Not for the
/// control cycle.
class Parameters {
 public:
  /// @param node a map, or empty.  @param block name of the block in messages
  Parameters(const YAML::Node& node, std::string block);

  bool has(const std::string& name) const;
  double number(const std::string& name, double fallback, double least, double most) const;
  int whole(const std::string& name, int fallback, int least, int most) const;
  bool flag(const std::string& name, bool fallback) const;
  std::string text(const std::string& name, const std::string& fallback) const;
  /// Reads a text that must be one of `allowed`.
  std::string choice(const std::string& name, const std::string& fallback,
                     const std::vector<std::string>& allowed) const;
  std::vector<std::string> texts(const std::string& name) const;
  /// Reads as many numbers as the fallback has; the absolute values are at most `most`.
  Eigen::VectorXd numbers(const std::string& name, const Eigen::VectorXd& fallback,
                          double most = 1e6) const;
  /// Returns a block inside this one; empty if there is none.
  Parameters block(const std::string& name) const;
  const YAML::Node& node() const { return node_; }
  /// Throws std::runtime_error: expected this, got the parameter's value.
  [[noreturn]] void refuse(const std::string& name, const std::string& expected) const;

 private:
  YAML::Node node_;
  std::string block_;
};

}  // namespace coglab_controllers
