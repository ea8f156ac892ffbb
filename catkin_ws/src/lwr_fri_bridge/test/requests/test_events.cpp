/// Events of ros_events and command, messages of outcomes, KRL conventions, and the diagnosis.
#include <gtest/gtest.h>

#include <stdexcept>

#include "lwr_fri_bridge/bridge/diagnosis.hpp"
#include "small_controller.hpp"

namespace lwr_fri_bridge {
namespace {

using fri::ControlStrategy;
using fri::KrlConvention;
using fri::KrlPhase;

std::string errorOf(const std::string& event) {
  try {
    parseEvent(event, ControlMode());
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

TEST(Events, KnownOnesAreRead) {
  const ControlMode current;
  EXPECT_EQ(parseEvent("start", current).kind, EventKind::Start);
  EXPECT_EQ(parseEvent(" hold ", current).kind, EventKind::Hold);
  EXPECT_EQ(parseEvent("reset", current).kind, EventKind::Reset);
  EXPECT_EQ(parseEvent("stop", current).kind, EventKind::Stop);
  EXPECT_EQ(parseEvent("position", current).mode.strategy, ControlStrategy::Position);
  const ControlMode joint =
      parseEvent("joint_impedance damping 0.3 stiffness 1,2,3,4,5,6,7", current).mode;
  EXPECT_EQ(joint.strategy, ControlStrategy::JointImpedance);
  EXPECT_DOUBLE_EQ(joint.joint_stiffness[6], 7.0);
  EXPECT_DOUBLE_EQ(joint.joint_damping[2], 0.3);
  const ControlMode frame =
      parseEvent("cartesian_impedance stiffness=1500 150 damping=0.8 0.9", joint).mode;
  EXPECT_EQ(frame.strategy, ControlStrategy::CartesianImpedance);
  EXPECT_DOUBLE_EQ(frame.cartesian_stiffness[2], 1500.0);
  EXPECT_DOUBLE_EQ(frame.cartesian_stiffness[3], 150.0);
  EXPECT_DOUBLE_EQ(frame.cartesian_damping[5], 0.9);
  EXPECT_DOUBLE_EQ(frame.joint_stiffness[6], 7.0);  // kept
}

TEST(Events, UnknownOnesAreRejectedWithTheList) {
  for (const char* event :
       {"", "jump", "start now", "joint_impedance 100", "joint_impedance stiffness",
        "joint_impedance stiffness 1 2", "joint_impedance stiffness 1x", "position stiffness 3",
        "joint_impedance stiffness 2001", "joint_impedance damping 0",
        "joint_impedance damping nan", "cartesian_impedance stiffness 5001 10",
        "cartesian_impedance stiffness 100"}) {
    const std::string error = errorOf(event);
    EXPECT_NE(error.find("start, hold, reset, stop, position"), std::string::npos)
        << event << ": " << error;
  }
  EXPECT_NE(errorOf("jump").find("'jump'"), std::string::npos);
  EXPECT_NE(errorOf("joint_impedance stiffness 2001").find("0.01..2000"), std::string::npos);
}

TEST(Diagnosis, GivesAHintWhenQualityIsPoor) {
  Snapshot s;
  FriThreadStatistics thread;
  for (const char* const number : {"port 49938", "12 s"}) {
    EXPECT_NE(diagnoseConnection(s, thread, 49938, 12.0).text.find(number), std::string::npos);
  }
  EXPECT_EQ(diagnoseConnection(s, thread, 49938, 12.0).code, ReasonCode::RobotDisconnected);
  EXPECT_EQ(diagnoseArm(s, 70.0).code, ReasonCode::RobotDisconnected);
  s.supervisor = SupervisorState::Monitor;
  s.sample.cycle_time = 0.001;
  s.quality = fri::Quality::Bad;
  s.miss_rate = 0.2F;
  s.latency = 0.0009F;
  EXPECT_NE(diagnoseConnection(s, thread, 49938, 0.0).text.find("real-time priority"),
            std::string::npos);
  thread.real_time = true;
  EXPECT_NE(diagnoseConnection(s, thread, 49938, 0.0).text.find("virtual machine"),
            std::string::npos);
  s.miss_rate = 0.0F;
  s.session.lost_measurements = 10;
  EXPECT_NE(diagnoseConnection(s, thread, 49938, 0.0).text.find("cable"), std::string::npos);
  EXPECT_EQ(diagnoseConnection(s, thread, 49938, 0.0).code, ReasonCode::PoorQuality);
  s.quality = fri::Quality::Perfect;
  EXPECT_EQ(diagnoseConnection(s, thread, 49938, 0.0).severity, Severity::Ok);
  EXPECT_EQ(diagnoseConnection(s, thread, 49938, 0.0).code, ReasonCode::None);
  thread.last_foreign = "127.0.0.1:9";
  EXPECT_NE(diagnoseConnection(s, thread, 49938, 0.0).text.find("127.0.0.1:9"), std::string::npos);
  EXPECT_EQ(diagnoseConnection(s, thread, 49938, 0.0).code, ReasonCode::SecondSender);
  s.sample.block = MotionBlock::Held;
  EXPECT_EQ(diagnoseArm(s, 70.0).code, ReasonCode::Held);
  s.temperature[2] = 80.0F;
  EXPECT_EQ(diagnoseArm(s, 70.0).code, ReasonCode::DriveWarning);
  s.drive_error = 0x10;
  EXPECT_NE(diagnoseArm(s, 70.0).text.find("lwr_a4"), std::string::npos);
  EXPECT_EQ(diagnoseArm(s, 70.0).code, ReasonCode::DriveError);
}

}  // namespace
}  // namespace lwr_fri_bridge
