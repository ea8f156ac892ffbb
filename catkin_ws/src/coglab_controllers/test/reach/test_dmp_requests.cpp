// Refused requests of the DMP plug-in: the reasons, and no effect on the running motion.
#include <cmath>
#include <functional>

#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

// A running motion, and an undisturbed copy of it.
class DmpRefusals : public ::testing::Test {
 protected:
  DmpRefusals() {
    for (VirtualRobot* one : {&robot, &twin}) {
      one->loadBoth();
      one->see("human_hand", kGoal);
      EXPECT_TRUE(VirtualRobot::ok(one->dmp().execute(one->reach())));
    }
  }

  // Each in a cycle of its own; the motion does not notice.
  void ask(const std::vector<std::function<void()>>& requests) {
    for (const auto& request : requests) {
      request();
      robot.see("human_hand", kGoal);
      twin.see("human_hand", kGoal);
      robot.tick();
      twin.tick();
      ASSERT_EQ(robot.command.velocity, twin.command.velocity);
    }
    EXPECT_EQ(robot.state(), MotionState::Running);
  }

  DmpRequest with(const std::function<void(DmpRequest&)>& change) {
    DmpRequest request = robot.reach();
    change(request);
    return request;
  }

  DmpController& dmp() { return robot.dmp(); }

  VirtualRobot robot, twin;
};

TEST_F(DmpRefusals, RefusesBadRequestsAndKeepsMoving) {
  ask({
      [&] {
        EXPECT_TRUE(refused(dmp().execute(with([](auto& r) { r.primitive_id = "wave"; })),
                            {"wave", "reach_human"}));
      },
      [&] {
        for (const double ratio : {0.0, -1.0, std::nan("")}) {
          EXPECT_TRUE(
              refused(dmp().execute(with([&](auto& r) { r.dmp_ratio = ratio; })), {"ratio"}));
        }
      },
      [&] {
        EXPECT_TRUE(refused(dmp().execute(with([](auto& r) {
          r.orientation_control = true;
          r.target_orientation << 0, 0, 0, 2;
        })),
                            {"target_orientation", "unit"}));
      },
      [&] {
        EXPECT_TRUE(refused(dmp().execute(with([](auto& r) { r.initial_state = 7; })),
                            {"initial_state", "CURRENT=0", "GIVEN=1"}));
      },
      [&] {
        EXPECT_TRUE(refused(dmp().execute(with([](auto& r) {
          r.initial_state = DmpRequest::kGiven;
          r.initial_position = Vector3(0.3, 0.3, 0.3);
        })),
                            {"initial_position"}));
      },
  });
}

TEST(DmpRequests, RequestsToAnInactiveControllerNameTheActiveOne) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  robot.see("human_hand", kGoal);
  const std::vector<std::string> words = {"'dmp'", "'ptp'", "switch_controller"};
  EXPECT_TRUE(refused(robot.dmp().execute(robot.reach()), words));
  EXPECT_TRUE(refused(robot.dmp().switchDmp(robot.reach()), words));
  robot.switchTo("dmp");
  const MotionAnswer answer = robot.ptp().add({std::vector<double>(7, 0.0), {}, {}});
  EXPECT_EQ(answer.status, MotionAnswer::kRejected);
  EXPECT_EQ(answer.code, ReasonCode::NotActive);
  EXPECT_NE(answer.message.find("active is 'dmp'"), std::string::npos) << answer.message;
  EXPECT_TRUE(refused(robot.dmp().switchDmp(robot.reach()), {"no motion", "execute_dmp"}));
}

TEST(DmpRequests, BadSwitchesLeaveTheRunningMotionAsItIs) {
  VirtualRobot robot, twin;
  for (VirtualRobot* one : {&robot, &twin}) {
    one->loadBoth();
    one->see("human_hand", kGoal);
    ASSERT_TRUE(VirtualRobot::ok(one->dmp().execute(one->reach())));
  }
  const auto refuse = [&robot](auto change, const std::vector<std::string>& words) {
    DmpRequest request = robot.reach();
    change(request);
    EXPECT_TRUE(refused(robot.dmp().switchDmp(request), words));
  };
  for (int i = 0; i < 100; ++i) {
    if (i == 50) {
      refuse([](auto& r) { r.primitive_id = "wave"; }, {"wave", "reach_human"});
      refuse([](auto& r) { r.dmp_ratio = 0.0; }, {"ratio", "0.05", "100"});
      refuse([](auto& r) { r.dmp_ratio = -2.0; }, {"ratio"});
      refuse([](auto& r) { r.goal_offset.x() = std::nan(""); }, {"goal_offset", "finite"});
      refuse(
          [](auto& r) {
            r.orientation_control = true;
            r.target_orientation << 0.5, 0, 0, 0.5;
          },
          {"target_orientation", "unit"});
    }
    for (VirtualRobot* one : {&robot, &twin}) {
      one->see("human_hand", kGoal);
      one->tick();
    }
    ASSERT_EQ(robot.command.velocity, twin.command.velocity);
  }
}

TEST(DmpRequests, ASwitchIgnoresStartAndFrame) {
  VirtualRobot robot;
  robot.loadBoth();
  robot.see("human_hand", kGoal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  robot.tick();
  DmpRequest request = robot.reach("give_human");
  request.initial_state = 7;
  request.initial_position = Vector3(9, 9, 9);
  request.goal_frame = "nowhere";
  EXPECT_TRUE(VirtualRobot::ok(robot.dmp().switchDmp(request)));
}

TEST(DmpRequests, NothingIsPredictedBeforeTheFirstJointState) {
  const VirtualRobot plain;
  ctrl_more::Logger logger;
  FrameTable frames;
  ManagerSettings settings = readManagerSettings(
      YAML::Load("{}"), readText(DESCRIPTION_DIR "/urdf/lwr_ih2.urdf"), plain.limits, true);
  settings.clock = [] { return std::int64_t{5'000'000'000}; };
  settings.logger = &logger;
  ControllerManager manager(std::move(settings));
  ASSERT_TRUE(VirtualRobot::ok(manager.load("dmp", "coglab/DmpController")));
  auto& dmp = dynamic_cast<DmpController&>(*manager.motion("dmp"));
  frames.frames["human_hand"].position = kGoal;
  frames.frames["human_hand"].stamp_ns = manager.now_ns();
  dmp.setGoalSource(&frames);
  int loaded = 0;
  ASSERT_TRUE(VirtualRobot::ok(dmp.loadDmps(PACKAGE_DIR "/config/primitives.xml", loaded)));
  PredictedPath path;
  const Answer answer = dmp.predict(plain.reach(), path);
  EXPECT_EQ(answer.code, ReasonCode::RobotDisconnected);
}

}  // namespace
}  // namespace coglab_controllers
