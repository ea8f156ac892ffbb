/// @file
/// Everything that can be set about the simulated cell, by name. The rows are in
/// parameter_table.inc.
#pragma once

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

/// What cell_node alone reads: where the bridge is, how fast it goes, what it publishes.
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
  plant::Object object;
  plant::Surroundings surroundings;
  plant::PersonParameters person;
  NodeParameters node;
};

/// A value as it comes from ROS parameters or Python.
using ParameterValue = std::variant<bool, int, double, std::string, std::vector<double>>;

/// One row of the table.
struct CellParameter {
  std::string name;  ///< such as "krc/quality_ok"
  std::string unit;
  std::string source;  ///< "published", "ours" or "set-up"
  std::string text;
  double low = 0.0, high = 0.0;  ///< range of numbers, also of each one in a list; equal: no number
  bool node_only = false;        ///< of cell_node; the cell without ROS does not have it
  std::function<ParameterValue(const CellConfig&)> get;
  /// @throws std::invalid_argument with name, value and range, or what was expected.
  std::function<void(CellConfig&, const ParameterValue&)> set;
};

/// All rows, in the order of the table.
const std::vector<CellParameter>& cellParameters();

/// Sets one parameter of the cell. @throws std::invalid_argument if the name is unknown, is one of
/// cell_node alone, or if the value does not fit.
void setCellParameter(CellConfig& config, const std::string& name, const ParameterValue& value);

}  // namespace coglab_sim
