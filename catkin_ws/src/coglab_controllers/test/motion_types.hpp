// Streams and trajectories, registered in a test's program: no plug-in library has them without
// ROS.
#pragma once

#include "coglab_controllers/manager/plugin_registry.hpp"
#include "coglab_controllers/plugins/joint_trajectory.hpp"
#include "coglab_controllers/plugins/stream_controller.hpp"

namespace coglab_controllers {

inline const MotionRegistration twist_stream_type(
    "coglab/TwistStream", {[]() -> MotionController* { return new TwistStream(); }, nullptr});
inline const MotionRegistration pose_stream_type(
    "coglab/PoseStream", {[]() -> MotionController* { return new PoseStream(); }, nullptr});
inline const MotionRegistration joint_velocity_stream_type(
    "coglab/JointVelocityStream",
    {[]() -> MotionController* { return new JointVelocityStream(); }, nullptr});

inline const MotionRegistration joint_trajectory_type(
    "coglab/JointTrajectory",
    {[]() -> MotionController* { return new JointTrajectory(); }, nullptr});

}  // namespace coglab_controllers
