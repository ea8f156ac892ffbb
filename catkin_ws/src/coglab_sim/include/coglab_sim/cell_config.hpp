/// @file
/// Everything that can be set about the simulated cell, by name.
///
/// The table behind `cellParameters()` is used by the node (ROS parameters), by the Python binding
/// (keyword arguments) and by the documentation, so that a figure has one name and one default.
/// Source tells `published` figures from `ours`.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "coglab_sim/krc/parameters.hpp"
#include "coglab_sim/krc/servos.hpp"
#include "coglab_sim/plant/plant.hpp"
#include "coglab_sim/torque_sensor.hpp"

namespace coglab_sim {

struct CellConfig {
  std::string urdf;  ///< path of the robot description
  std::uint64_t seed = 1;
  /// rad; the home posture of the system.
  Vector7 home = (Vector7() << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782).finished();
  std::string hand_model;  ///< path of another table of the hand; empty: the one built in
  krc::Parameters krc;
  krc::ServoParameters servos;
  plant::Drives drives;
  TorqueNoise torque_noise;
  plant::Object object;
  plant::Surroundings surroundings;
  plant::PersonFigures person;
  std::string object_start = "human_hand";  ///< human_hand, robot_hand, world
  /// In that frame; the default is how the virtual human carries a mug.
  Pose object_pose{Vector3d(-0.08, 0.0, -0.05), Quaterniond::Identity()};
};

/// A value as it comes from ROS parameters or Python.
using ParameterValue = std::variant<bool, int, double, std::string, std::vector<double>>;

/// One row of the table.
struct CellParameter {
  std::string name;  ///< such as "krc/quality_ok"
  std::string unit;
  std::string source;  ///< "published", "ours" or "set-up"
  std::string description;
  double low = 0.0, high = 0.0;  ///< range of numbers, also of each one in a list; equal: no number
  std::function<ParameterValue(const CellConfig&)> get;
  /// @throws std::invalid_argument with name, value and range, or what was expected.
  std::function<void(CellConfig&, const ParameterValue&)> set;
};

/// All rows, in a fixed order.
const std::vector<CellParameter>& cellParameters();

/// Sets one parameter. @throws std::invalid_argument if the name is unknown or the value does not
/// fit.
void setCellParameter(CellConfig& config, const std::string& name, const ParameterValue& value);

}  // namespace coglab_sim
