// Requests of the DMP plug-in that are refused: why, and that the running motion does not notice.
#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

const Vector3 kGoal(0.80, 0.0, 0.45);

// A motion under way, beside a twin that nothing disturbs.
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

TEST_F(DmpRefusals, RefusesBadGoalsAndKeepsMoving) {
  ask({
      [&] {
        EXPECT_TRUE(refused(
            dmp().execute(with([](auto& r) { r.goal_offset = Vector3(std::nan(""), 0, 0); })),
            {"goal_offset"}));
      },
      [&] {
        for (const double speed : {-0.1, 0.01, 0.5, 3.0, std::nan("")}) {
          EXPECT_TRUE(refused(dmp().execute(with([&](auto& r) { r.arrival_speed = speed; })),
                              {"arrival_speed", "0.02 to 0.45"}));
        }
        EXPECT_TRUE(refused(dmp().execute(with([](auto& r) { r.goal_approach.x() = 0.4; })),
                            {"goal_approach", "0.3 m"}));
      },
      [&] {
        EXPECT_TRUE(refused(dmp().execute(with([](auto& r) { r.goal_frame = "cup"; })), {"cup"}));
      },
      [&] {
        EXPECT_TRUE(refused(dmp().execute(with([](auto& r) { r.goal_limits.retreat = -0.1; })),
                            {"goal_retreat", "negative"}));
        EXPECT_TRUE(
            refused(dmp().execute(with([](auto& r) { r.goal_limits.region_low.x() = 0.1; })),
                    {"goal_region_low", "above"}));
        EXPECT_TRUE(refused(dmp().execute(with([](auto& r) { r.goal_limits.drop = std::nan(""); })),
                            {"goal_drop", "finite"}));
      },
      [&] {
        robot.see("far", Vector3(3.0, 0.0, 0.5));
        EXPECT_TRUE(refused(dmp().execute(with([](auto& r) { r.goal_frame = "far"; })),
                            {"workspace", "box"}));
      },
      [&] {
        robot.see("nan", Vector3(std::nan(""), 0.0, 0.5));
        EXPECT_TRUE(
            refused(dmp().execute(with([](auto& r) { r.goal_frame = "nan"; })), {"finite"}));
      },
      [&] {  // the motion belongs to a frame: kept for one that belongs to dmp_goal
        const Answer answer = dmp().setGoal("lwr_base_link", Vector3(0.5, 0.2, 0.5), 0);
        EXPECT_TRUE(VirtualRobot::ok(answer));
        EXPECT_NE(answer.message.find("goal_frame 'human_hand'"), std::string::npos);
      },
  });
}

TEST_F(DmpRefusals, RefusesWhatIsNotThereAndKeepsMoving) {
  int loaded = 7;
  ask({
      [&] { EXPECT_TRUE(refused(dmp().loadDmps("/nowhere.xml", loaded), {"/nowhere.xml"})); },
      [&] {
        MotionAnswer answer = robot.ptp().add({std::vector<double>(7, 0.0), {}, {}});
        EXPECT_EQ(answer.status, MotionAnswer::kRejected);
        EXPECT_NE(answer.message.find("active is 'dmp'"), std::string::npos) << answer.message;
      },
      [&] {
        std::string type;
        EXPECT_TRUE(refused(robot.manager->switchTo("nobody", type), {"nobody", "dmp", "ptp"}));
      },
  });
  EXPECT_EQ(loaded, 0);
}

TEST(DmpRequests, TopicGoalInAnotherFrameOrNotFiniteIsRefused) {
  VirtualRobot robot;
  robot.loadBoth();
  DmpRequest request = robot.reach();
  request.goal_frame.clear();
  EXPECT_TRUE(refused(robot.dmp().execute(request), {"dmp_goal", "goal_frame"}));
  EXPECT_TRUE(refused(robot.dmp().setGoal("world", kGoal, 0), {"world", "lwr_base_link"}));
  EXPECT_TRUE(
      refused(robot.dmp().setGoal("lwr_base_link", Vector3(0, std::nan(""), 0), 0), {"finite"}));
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().setGoal("lwr_base_link", Vector3(0, 0, 5), 0)));
  EXPECT_TRUE(refused(robot.dmp().execute(request), {"workspace"}));
}

TEST(DmpRequests, RequestsToAnInactiveControllerNameTheActiveOne) {
  VirtualRobot robot;
  robot.loadBoth("ptp");
  robot.see("human_hand", kGoal);
  const std::vector<std::string> words = {"'dmp' is not active", "'ptp'", "switch_controller"};
  EXPECT_TRUE(refused(robot.dmp().execute(robot.reach()), words));
  EXPECT_TRUE(refused(robot.dmp().switchDmp(robot.reach()), words));
  robot.switchTo("dmp");
  const MotionAnswer answer = robot.ptp().add({std::vector<double>(7, 0.0), {}, {}});
  EXPECT_EQ(answer.status, MotionAnswer::kRejected);
  EXPECT_NE(answer.message.find("'ptp' is not active; active is 'dmp'"), std::string::npos)
      << answer.message;
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

}  // namespace
}  // namespace coglab_controllers
