/// @file
/// Frames of the tool: the Cartesian command that belongs to a joint set-point, and the external
/// force in the tool's axes.
#pragma once

#include <Eigen/Geometry>

#include "lwr_fri_bridge/fri/datagram.hpp"

namespace lwr_fri_bridge {

/// Pose of the flange in the base frame, m (facts: kinematics of the LWR 4+, alternating twists,
/// all a = 0). Real-time safe.
Eigen::Isometry3d flangePose(const Vector7& joints);

/// In Cartesian impedance mode the controller follows a frame and not joint positions. This class
/// moves the frame that the controller reports by what the joint set-point has moved since: F(q) =
/// P(q) P(q0)^-1 F0 with P the pose of the flange. The tool
/// ($STIFFNESS.TOOL) cancels; $STIFFNESS.BASE is taken as the robot's base. Real-time safe.
class CartesianSetPoint {
 public:
  /// Ties a joint set-point (rad) to the frame (3x4, m) the controller holds.
  void anchor(const Vector7& joints, const float (&frame)[fri::kFrameValues]);

  /// The frame for another joint set-point.
  void frame(const Vector7& joints, float (&frame)[fri::kFrameValues]) const;

 private:
  Eigen::Isometry3d relative_ = Eigen::Isometry3d::Identity();  // P(q0)^-1 F0
};

/// The controller's estimate about the origin of its selected tool ($STIFFNESS.TOOL), turned into
/// the tool's axes: Fx Fy Fz Tx Ty Tz, N and Nm. On the wire it has the axes of
/// $STIFFNESS.TASKFRAME: those of the base with #BASE, as our KRL program sets it, or already the
/// tool's with #TOOL (`in_tool_axes`). The tool's orientation is that of the measured frame of the
/// same datagram; of a controller that does not fill it, the flange's at the measured joints.
/// Real-time safe.
Vector6 toolWrench(const fri::MeasurementDatagram& measurement, bool in_tool_axes);

}  // namespace lwr_fri_bridge
