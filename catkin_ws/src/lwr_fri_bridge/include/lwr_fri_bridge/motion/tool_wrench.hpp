/// @file
/// The external force and torque at the tool, in the tool's axes.
#pragma once

#include "lwr_fri_bridge/fri/datagram.hpp"

namespace lwr_fri_bridge {

/// The controller's estimate about the origin of its selected tool ($STIFFNESS.TOOL), turned into
/// the tool's axes: Fx Fy Fz Tx Ty Tz, N and Nm. On the wire it has the axes of
/// $STIFFNESS.TASKFRAME: those of the base with #BASE, as our KRL program sets it, or already the
/// tool's with #TOOL (`in_tool_axes`). The tool's orientation is that of the measured frame of the
/// same datagram; of a controller that does not fill it, the flange's at the measured joints.
/// Real-time safe.
Vector6 toolWrench(const fri::MeasurementDatagram& measurement, bool in_tool_axes);

}  // namespace lwr_fri_bridge
