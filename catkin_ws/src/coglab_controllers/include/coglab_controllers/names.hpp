/// @file
/// Names of coglab_rt that this package and its plug-ins use.
#pragma once

#include "coglab_rt/arm_port.hpp"
#include "coglab_rt/clock.hpp"
#include "coglab_rt/event_ring.hpp"
#include "coglab_rt/fixed_text.hpp"
#include "coglab_rt/plan_exchange.hpp"
#include "coglab_rt/reason.hpp"

namespace coglab_controllers {

using coglab_rt::Answer;
using coglab_rt::EventRing;
using coglab_rt::FixedText;
using coglab_rt::MotionBlock;
using coglab_rt::Name;
using coglab_rt::PlanExchange;
using coglab_rt::PlanOutcome;
using coglab_rt::Reason;
using coglab_rt::ReasonCode;
using coglab_rt::RobotSample;
using coglab_rt::steadyNow;
using coglab_rt::TripleBuffer;
using coglab_rt::VelocityCommand;

}  // namespace coglab_controllers
