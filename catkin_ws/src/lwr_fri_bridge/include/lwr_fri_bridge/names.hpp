/// @file
/// Names of coglab_rt that this package uses, and joint names.
#pragma once

#include "coglab_rt/arm_port.hpp"
#include "coglab_rt/braking.hpp"
#include "coglab_rt/clock.hpp"
#include "coglab_rt/event_ring.hpp"
#include "coglab_rt/interpolator.hpp"
#include "coglab_rt/joint_limits.hpp"
#include "coglab_rt/real_time.hpp"
#include "coglab_rt/reason.hpp"

namespace lwr_fri_bridge {

using coglab_rt::ArmMailboxes;
using coglab_rt::AxisState;
using coglab_rt::BoundedThread;
using coglab_rt::BrakingGuard;
using coglab_rt::brakingSpeed;
using coglab_rt::EventRing;
using coglab_rt::Interpolator;
using coglab_rt::JointLimits;
using coglab_rt::kFutureAllowance_ns;
using coglab_rt::LossBudget;
using coglab_rt::MotionBlock;
using coglab_rt::planVelocity;
using coglab_rt::ReasonCode;
using coglab_rt::RobotSample;
using coglab_rt::steadyNow;
using coglab_rt::TripleBuffer;
using coglab_rt::Vector6;
using coglab_rt::Vector7;
using coglab_rt::VelocityCommand;

/// Names of the joints in the order of FRI.
constexpr const char* kJointNames[7] = {"lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3",
                                        "lwr_a4", "lwr_a5", "lwr_a6"};

}  // namespace lwr_fri_bridge
