/// @file
/// The cell's parameter table on the ROS parameter server.
#pragma once

#include <ros/node_handle.h>

#include "coglab_sim/cell_config.hpp"

namespace coglab_sim {

/// Reads the file of the object `object/id`, then all rows of the table that are set under `node`,
/// the path of the robot description (default: that of lwr_description), and `fri_period` and
/// `seed` of the parent namespace.
/// @throws std::invalid_argument naming the unknown parameter or the value that does not fit.
CellConfig readCellConfig(const ros::NodeHandle& node);

/// Reads mass, size, shape and friction of an object from its file. The parameter `objects` under
/// `node` is the folder (default: that of coglab_objects). @throws std::invalid_argument naming the
/// file.
plant::Object readObject(const ros::NodeHandle& node, const std::string& id);

}  // namespace coglab_sim
