/// @file
/// The cell's parameter table on the ROS parameter server.
#pragma once

#include <ros/node_handle.h>

#include "coglab_sim/cell_config.hpp"

namespace coglab_sim {

/// Reads every row of the table that is set under `node`, besides the robot description's path (by
/// default that of lwr_description), and `fri_period` and `seed` of the namespace above.
/// @throws std::invalid_argument naming what is unknown or does not fit.
CellConfig readCellConfig(const ros::NodeHandle& node);

/// Parameters of an object from `objects/<id>` under `node`. @throws std::invalid_argument if there
/// are none.
plant::Object readObject(const ros::NodeHandle& node, const std::string& id);

}  // namespace coglab_sim
