// Requests of the DMP plug-in that are refused: why, and that the running motion does not notice.
#include <cmath>
#include <functional>
#include <sstream>
#include <utility>

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

TEST(DmpRequests, ASwitchLooksNeitherAtAStartNorAtAFrame) {
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

/// What predict_dmp says, which checks as execute_dmp does and begins nothing.
std::string says(VirtualRobot& robot, const std::function<void(DmpRequest&)>& change) {
  robot.see("human_hand", kGoal);
  robot.see("far", Vector3(1.9, 0.1, 0.5));
  DmpRequest request = robot.reach();
  change(request);
  PredictedPath path;
  const Answer answer = robot.dmp().predict(request, path);
  EXPECT_EQ(answer.success, path.motion == "reach_human");
  if (answer.success) {
    EXPECT_EQ(path.stamp_ns, robot.now_ns);
  }
  return answer.message;
}

TEST(DmpRequests, AreRefusedInWholeSentences) {
  VirtualRobot robot;
  robot.loadBoth();
  using R = DmpRequest;
  const Vector3 hand = robot.hand().position;
  std::ostringstream where;
  where << "(" << hand.x() << ", " << hand.y() << ", " << hand.z() << ") m";
  const std::pair<std::function<void(R&)>, std::string> refusals[] = {
      {[](R& r) { r.arrival_speed = 0.01; },
       "arrival_speed is 0.010000 m/s; expected 0 (as the primitive has it) or 0.02 to 0.45 m/s"},
      {[](R& r) { r.goal_approach = Vector3(0.4, -0.1, 0.2); },
       "goal_approach (0.4, -0.1, 0.2) m is not finite or longer than 0.3 m"},
      {[](R& r) { r.goal_offset.y() = std::nan(""); },
       "goal_offset holds a number that is not finite"},
      {[](R& r) {
         r.orientation_control = true;
         r.target_orientation << 0, 0, 0, 2;
       },
       "target_orientation has norm 2; expected a unit quaternion x y z w, or all zero to keep the "
       "present orientation"},
      {[](R& r) {
         r.orientation_control = true;
         r.target_orientation << std::nan(""), 0, 0, 1;
       },
       "target_orientation holds a number that is not finite"},
      {[](R& r) { r.initial_state = 7; },
       "initial_state 7 is unknown; expected CURRENT=0 or GIVEN=1"},
      {[](R& r) {
         r.initial_state = R::kGiven;
         r.initial_velocity.z() = std::nan("");
       },
       "initial_position or initial_velocity holds a number that is not finite"},
      {[](R& r) { r.goal_frame = "far"; },
       "the hand's goal (1.9, 0.1, 0.5) m is 0.700000 m outside the workspace (upper side of the "
       "workspace box); box from (-1.2, -1.2, 0) m to (1.2, 1.2, 1.6) m, 0.250000 m from the base"},
      {[&](R& r) {
         r.initial_state = R::kGiven;
         r.initial_position = hand + Vector3(0.0, 0.3, 0.0);
       },
       "initial_position is 0.300000 m from the hand at " + where.str() +
           "; allowed: 0.100000 m (max_initial_distance); use initial_state CURRENT"},
      {[&](R& r) {
         r.initial_state = R::kGiven;
         r.initial_position = hand;
         r.initial_velocity = Vector3(0, 3, 4);
       },
       "initial_velocity is 5.000000 m/s; expected at most 2 m/s"}};
  for (const auto& [change, words] : refusals) EXPECT_EQ(says(robot, change), words);
}

TEST(DmpRequests, AreTakenExactlyUpToTheirLimits) {
  VirtualRobot robot("dmp: {max_initial_distance: 0}");
  robot.loadBoth();
  EXPECT_EQ(says(robot, [](DmpRequest& r) { r.goal_approach = Vector3(0.3, 0, 0); }), "");
  EXPECT_EQ(says(robot,
                 [&](DmpRequest& r) {
                   r.initial_state = DmpRequest::kGiven;
                   r.initial_position = robot.hand().position;
                   r.initial_velocity = Vector3(0, 2, 0);
                 }),
            "");
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
  EXPECT_EQ(answer.message, "no joint state has come yet; is the arm there?");
}

}  // namespace
}  // namespace coglab_controllers
