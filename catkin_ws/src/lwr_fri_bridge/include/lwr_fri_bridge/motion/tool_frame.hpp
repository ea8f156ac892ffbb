/// @file
/// Frames of the tool: the Cartesian command for a joint set-point, and the external wrench in the
/// tool's axes.
#pragma once

#include <Eigen/Geometry>

#include "lwr_fri_bridge/fri/datagram.hpp"

namespace lwr_fri_bridge {

/// Pose of the flange in the base frame, m (facts: kinematics of the LWR 4+, alternating twists,
/// all a = 0). Real-time safe.
Eigen::Isometry3d flangePose(const Vector7& joints);

/// Computes the frame for a joint set-point. In Cartesian impedance mode the controller follows a
/// frame, not joint positions. The reported frame F0 at the set-point q0 moves with the joint
/// set-point: F(q) = P(q) P(q0)^-1 F0, where P is the pose of the flange. The tool
/// ($STIFFNESS.TOOL) cancels; $STIFFNESS.BASE is assumed to be the robot's base. Real-time safe.
class CartesianSetPoint {
 public:
  /// Sets the joint set-point q0 (rad) and the frame F0 (3x4, m) that the controller holds.
  void anchor(const Vector7& joints, const float (&frame)[fri::kFrameValues]);

  /// Computes the frame F(q) (3x4, m) for a joint set-point q (rad).
  void frame(const Vector7& joints, float (&frame)[fri::kFrameValues]) const;

 private:
  Eigen::Isometry3d relative_ = Eigen::Isometry3d::Identity();  // P(q0)^-1 F0
};

/// External wrench about the origin of the selected tool ($STIFFNESS.TOOL), as estimated by the
/// controller and rotated into the tool's axes: Fx Fy Fz Tx Ty Tz, N and Nm. On the wire it has the
/// axes of $STIFFNESS.TASKFRAME: the base's axes with #BASE, as our KRL program sets it, or the
/// tool's axes with #TOOL (`in_tool_axes`). The tool's orientation comes from the measured frame of
/// the same datagram. If the controller does not fill that frame, the flange's orientation at the
/// measured joints is used. Real-time safe.
Vector6 toolWrench(const fri::MeasurementDatagram& measurement, bool in_tool_axes);

}  // namespace lwr_fri_bridge
