/// @file
/// All parameters of the simulated cell, by name. Their rows are in parameter_table.inc.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "coglab_sim/krc/parameters.hpp"
#include "coglab_sim/krc/servos.hpp"
#include "coglab_sim/palm_sensors.hpp"
#include "coglab_sim/plant/plant.hpp"
#include "coglab_sim/torque_sensor.hpp"

namespace coglab_sim {

/// Parameters of cell_node only: address of the bridge, pace and publications.
struct NodeParameters {
#define NODE(type, field, value, ...) type field = value;
#include "coglab_sim/parameter_table.inc"
};

struct CellConfig {
#define CELL(type, field, value, ...) type field = value;
#include "coglab_sim/parameter_table.inc"
  krc::Parameters krc;
  krc::ServoParameters servos;
  plant::Drives drives;
  TorqueNoise torque_noise;
  PalmNoise palm_noise;
  plant::Object object;
  plant::Surroundings surroundings;
  plant::PersonParameters person;
  NodeParameters node;
};

/// Value of a parameter, as ROS or Python passes it.
using ParameterValue = std::variant<bool, int, double, std::string, std::vector<double>>;

/// One row of the table.
struct CellParameter {
  std::string name;  ///< such as "krc/quality_ok"
  std::string unit;
  std::string source;  ///< "published", "ours" or "set-up"
  std::string text;
  double low = 0.0, high = 0.0;  ///< range of a number or of each list element; equal: not a number
  bool node_only = false;        ///< true: only cell_node has it, the cell without ROS does not
  std::function<ParameterValue(const CellConfig&)> get;
  /// @throws std::invalid_argument with name, value and range, or the expected type.
  std::function<void(CellConfig&, const ParameterValue&)> set;
};

/// All rows, in the order of the table.
const std::vector<CellParameter>& cellParameters();

/// Sets one parameter of the cell. @throws std::invalid_argument if the name is unknown, belongs to
/// cell_node only, or if the value does not fit.
void setCellParameter(CellConfig& config, const std::string& name, const ParameterValue& value);

}  // namespace coglab_sim
