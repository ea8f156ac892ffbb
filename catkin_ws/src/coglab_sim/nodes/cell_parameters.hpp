/// @file
/// The cell's parameter table on the ROS parameter server.
#pragma once

#include <ros/node_handle.h>

#include "coglab_sim/cell_config.hpp"

namespace coglab_sim {

/// Reads the file of the object that `object/id` names, then every row of the table that is set
/// under `node`, besides the robot description's path (by default that of lwr_description), and
/// `fri_period` and `seed` of the namespace above.
/// @throws std::invalid_argument naming what is unknown or does not fit.
CellConfig readCellConfig(const ros::NodeHandle& node);

/// Mass, size, shape and friction of an object from its file in the folder `objects`, a parameter
/// under `node` (by default that of coglab_objects). @throws std::invalid_argument naming the file.
plant::Object readObject(const ros::NodeHandle& node, const std::string& id);

}  // namespace coglab_sim
