/// Parts of the cell's node, without a master: messages from and to the cell's types, faults by
/// name, and data of the cell's thread for other threads.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "cell_faults.hpp"
#include "cell_messages.hpp"
#include "port_wait.hpp"

using namespace coglab_sim;

namespace {

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinite = std::numeric_limits<double>::infinity();

geometry_msgs::Pose poseOfNumbers(double x, double y, double z, double w) {
  geometry_msgs::Pose pose;
  pose.position.x = x;
  pose.position.y = y;
  pose.position.z = z;
  pose.orientation.w = w;
  return pose;
}

coglab_msgs::MotorCommands motors(double speed, double target, double current) {
  coglab_msgs::MotorCommands message;
  message.speed.assign(5, speed);
  message.target.assign(5, target);
  message.current.assign(5, current);
  return message;
}

std::string refusalOf(const coglab_msgs::MotorCommands& message) {
  try {
    motorsOf(message);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

/// A cell whose thread runs twenty times as fast as real time, without a peer.
struct Running {
  Running() : cell(config(), "127.0.0.1", 9, 20.0) { cell.start(); }
  ~Running() { cell.stop(); }
  static CellConfig config() {
    CellConfig config;
    config.urdf = URDF;
    return config;
  }
  /// Waits until the condition holds between two periods; false after so many simulated seconds.
  bool until(const std::function<bool(Cell&)>& condition, double limit = 20.0) {
    bool holds = false;
    double now = 0.0, end = -1.0;
    do {
      cell.apply(
          [&](Cell& c) {
            holds = condition(c);
            now = c.controller().time();
          },
          30.0);
      if (end < 0.0) end = now + limit;
    } while (!holds && now < end);
    return holds;
  }
  RealTimeCell cell;
};

}  // namespace

TEST(Messages, APoseIsTakenWithinAHundredMetresAndAHundredthOfItsLength) {
  Pose pose;
  EXPECT_TRUE(poseOf(poseOfNumbers(1.0, -2.0, 3.0, 1.009), pose));
  EXPECT_EQ(pose.position, Vector3d(1.0, -2.0, 3.0));
  EXPECT_EQ(pose.rotation.norm(), 1.0);
  for (const double there : {100.0, -100.0})
    EXPECT_TRUE(poseOf(poseOfNumbers(0, there, 0, 1), pose));
  for (const double beyond : {100.1, -100.1, kNoNumber, kInfinite}) {
    EXPECT_FALSE(poseOf(poseOfNumbers(beyond, 0, 0, 1), pose)) << beyond;
    EXPECT_FALSE(poseOf(poseOfNumbers(0, beyond, 0, 1), pose)) << beyond;
    EXPECT_FALSE(poseOf(poseOfNumbers(0, 0, beyond, 1), pose)) << beyond;
  }
  for (const double length : {0.0, 0.989, 1.011, -1.011, kNoNumber})
    EXPECT_FALSE(poseOf(poseOfNumbers(0, 0, 0, length), pose)) << length;
  geometry_msgs::Pose turned = poseOfNumbers(0, 0, 0, 0.8);
  turned.orientation.y = 0.6;
  ASSERT_TRUE(poseOf(turned, pose));
  EXPECT_NEAR(pose.rotation.y(), 0.6, 1e-12);
  EXPECT_NEAR(pose.rotation.w(), 0.8, 1e-12);
  const geometry_msgs::Pose back = poseMessage(pose);
  EXPECT_NEAR(back.orientation.y, 0.6, 1e-12);
  EXPECT_EQ(back.orientation.x + back.orientation.z, 0.0);
  EXPECT_TRUE(isWithin(Vector3d(3.0, -3.0, 3.0), 3.0));
  EXPECT_FALSE(isWithin(Vector3d(0.0, -3.001, 0.0), 3.0));
  EXPECT_FALSE(isWithin(Vector3d(0.0, kNoNumber, 0.0), 3.0));
}

TEST(Messages, CommandsOfMotorsHaveTheirRanges) {
  EXPECT_EQ(refusalOf(motors(0.0, 0.0, 0.0)), "");
  EXPECT_EQ(refusalOf(motors(1.0, 1.0, 1e4)), "");
  EXPECT_NE(refusalOf(motors(1.01, 0.5, 1.0)).find("speed"), std::string::npos);
  EXPECT_NE(refusalOf(motors(0.5, 1.01, 1.0)).find("target"), std::string::npos);
  EXPECT_NE(refusalOf(motors(0.5, 0.5, 10001.0)).find("current"), std::string::npos);
  EXPECT_NE(refusalOf(motors(-0.01, 0.5, 1.0)), "");
  EXPECT_NE(refusalOf(motors(0.5, kNoNumber, 1.0)), "");
  coglab_msgs::MotorCommands message = motors(0.5, 0.25, 100.0);
  message.speed[4] = 0.75;
  message.target[0] = 0.125;
  message.current[2] = 7.0;
  const MotorCommands commands = motorsOf(message);
  EXPECT_EQ(commands[4].speed, 0.75);
  EXPECT_EQ(commands[3].speed, 0.5);
  EXPECT_EQ(commands[0].target, 0.125);
  EXPECT_EQ(commands[2].current, 7.0);
  message.current.pop_back();
  EXPECT_NE(refusalOf(message).find("current of 5 motors"), std::string::npos);
  message = motors(0.5, 0.5, 1.0);
  message.speed.push_back(0.5);
  EXPECT_NE(refusalOf(message).find("speed of 5 motors"), std::string::npos);
}

TEST(Faults, AreRefusedByTheirNameAndRange) {
  Running running;
  const auto refusal = [&](const std::string& kind, double value) -> std::string {
    try {
      injectFault(running.cell, kind, value, 0.0);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(refusal("earthquake", 1.0).find("known: block"), std::string::npos);
  EXPECT_NE(refusal("block", kNoNumber).find("finite"), std::string::npos);
  EXPECT_NE(refusal("packet_loss", 1.1).find("range 0..1"), std::string::npos);
  EXPECT_NE(refusal("lose_packets", -1.0).find("range 0..1e+06"), std::string::npos);
  EXPECT_NE(refusal("silence", 2e6).find("range 0..1e+06"), std::string::npos);
  EXPECT_NE(refusal("drive_error", 7.0).find("joint 7"), std::string::npos);
  EXPECT_NE(refusal("reopen", 0.2).find("krc/period = 0.2"), std::string::npos);
  EXPECT_EQ(refusal("acknowledge", 0.0), "");
}

TEST(Faults, ActAndAreUndoneAfterTheirTime) {
  Running running;
  RealTimeCell& cell = running.cell;
  ASSERT_TRUE(running.until([](Cell& c) { return c.controller().power() == 0x7F; }));
  injectFault(cell, "enabling_switch", 0.0, 2.0);
  double begin = cell.snapshot().truth.time;
  ASSERT_TRUE(running.until([](Cell& c) { return c.controller().power() == 0; }, 1.0));
  ASSERT_TRUE(running.until([](Cell& c) { return c.controller().power() == 0x7F; }));
  EXPECT_GE(cell.snapshot().truth.time - begin, 1.9);
  injectFault(cell, "drive_error", 3.0, 1.0);
  ASSERT_TRUE(running.until([](Cell& c) { return c.controller().power() == 0; }, 1.0));
  EXPECT_TRUE(running.until(
      [](Cell& c) { return c.controller().messages().back().text == "messages acknowledged"; }));
  injectFault(cell, "leave_command_mode", 0.0, 0.0);
  EXPECT_TRUE(running.until(
      [](Cell& c) { return c.controller().messages().back().text == "fault injected"; }, 1.0));
  injectFault(cell, "acknowledge", 0.0, 0.0);
  EXPECT_TRUE(running.until(
      [](Cell& c) { return c.controller().messages().back().text == "messages acknowledged"; },
      1.0));
  injectFault(cell, "silence", 2.0, 0.0);
  EXPECT_TRUE(running.until([](Cell& c) { return !c.controller().sends(); }, 1.0));
  begin = cell.snapshot().truth.time;
  EXPECT_TRUE(running.until([](Cell& c) { return c.controller().sends(); }));
  EXPECT_GE(cell.snapshot().truth.time - begin, 1.0);
  injectFault(cell, "packet_loss", 1.0, 1.0);
  EXPECT_TRUE(running.until([](Cell& c) { return !c.sent(); }, 1.0));
  EXPECT_TRUE(running.until([](Cell& c) { return c.sent(); }));
  injectFault(cell, "lose_packets", 200.0, 0.0);
  EXPECT_TRUE(running.until([](Cell& c) { return !c.sent(); }, 1.0));
  EXPECT_TRUE(running.until([](Cell& c) { return c.sent(); }));
  injectFault(cell, "reopen", 0.02, 0.0);
  EXPECT_TRUE(
      running.until([](Cell& c) { return c.period() == 0.02 && !c.controller().sends(); }, 1.0));
  EXPECT_TRUE(running.until([](Cell& c) { return c.controller().sends(); }, 2.0));
}

TEST(RealTimeCell, LeavesRecordsMessagesAndASnapshot) {
  Running running;
  RealTimeCell& cell = running.cell;
  ASSERT_TRUE(running.until([](Cell& c) { return c.controller().power() == 0x7F; }));
  cell.apply([](Cell& c) {
    c.controller().leaveCommandMode("one");
    c.controller().leaveCommandMode("two");
  });
  ASSERT_TRUE(running.until([&](Cell&) { return cell.snapshot().tick > 200; }));
  cell.stop();
  const CellSnapshot snapshot = cell.snapshot();
  const auto messages = cell.takeMessages();
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[0].text, "one");
  EXPECT_EQ(messages[1].text, "two");
  EXPECT_TRUE(cell.takeMessages().empty());
  const auto records = cell.takeRecords();
  ASSERT_EQ(records.size(), snapshot.tick);
  EXPECT_TRUE(cell.takeRecords().empty());
  // However late the reader is, nothing is lost, and each has the time of its own step.
  const auto kept = cell.takeSnapshots();
  ASSERT_EQ(kept.size(), std::min<std::uint64_t>(snapshot.tick, 2000));
  for (std::size_t i = 1; i < kept.size(); ++i) {
    EXPECT_EQ(kept[i].tick, kept[i - 1].tick + 1);
    EXPECT_GT(kept[i].stepped_ns, kept[i - 1].stepped_ns);
  }
  EXPECT_EQ(kept.back().truth.time, snapshot.truth.time);
  EXPECT_EQ(records.back().time, snapshot.truth.time);
  EXPECT_NEAR(records[10].time - records[9].time, 0.005, 1e-9);
  EXPECT_EQ(records.back().state, 1);
  EXPECT_EQ(records.back().quality, 0);
  EXPECT_EQ(records.back().control, 1);
  EXPECT_EQ(records.front().power, 0);
  EXPECT_FALSE(records.back().answered);
  EXPECT_EQ(records.back().measured, snapshot.truth.position);
  EXPECT_EQ(records.back().commanded, snapshot.truth.set_point);
  EXPECT_EQ(snapshot.answers, 0U);
  EXPECT_EQ(snapshot.touch.phalanges.size(), 11U);
  EXPECT_EQ(cell.failure(), "");
  EXPECT_EQ(snapshot.refused_hand, "");
}

TEST(RealTimeCell, StampsAreOfThePhysicsStepHoweverLateTheyArePublished) {
  ros::Time::init();
  Running running;
  RealTimeCell& cell = running.cell;
  ASSERT_TRUE(running.until([&](Cell&) { return cell.snapshot().tick > 20; }));
  cell.stop();
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  for (const CellSnapshot& each : cell.takeSnapshots()) {
    const ros::Time stamp = stampOf(each, false);
    EXPECT_LT(stamp, ros::Time::now() - ros::Duration(0.25));
    EXPECT_EQ(truthMessage(each.truth, "mug", stamp).header.stamp, stamp);
    EXPECT_EQ(stampOf(each, true), ros::Time(each.truth.time));
  }
}

TEST(PortWait, ALateBridgeIsAwaitedWithReminders) {
  EXPECT_GE(NodeParameters().port_wait, 600.0);  // a busy computer starts the robot slowly
  double now = 0.0;
  std::vector<double> reminders;
  const auto wait = [&](double limit, double bound_at, double shutdown_at) {
    now = 0.0;
    reminders.clear();
    return pollPort(
        limit, [&] { return static_cast<std::uint16_t>(now >= bound_at ? 4000 : 0); },
        [&] { return now; }, [&](double waited) { reminders.push_back(waited); },
        [&] { return (now += 0.5) < shutdown_at; });
  };
  EXPECT_EQ(wait(600.0, 100.0, 1e9), 4000);
  EXPECT_EQ(reminders, (std::vector<double>{30.0, 60.0, 90.0}));
  EXPECT_EQ(wait(0.2, 100.0, 1e9), 0);
  EXPECT_TRUE(reminders.empty());
  EXPECT_EQ(wait(600.0, 100.0, 10.0), 0);
  EXPECT_EQ(wait(0.0, 0.0, 1e9), 4000);
}

TEST(RealTimeCell, UsesItsInputsAndReportsWhyAHandIsRefused) {
  Running running;
  RealTimeCell& cell = running.cell;
  MotorCommands commands;
  commands[2] = {1.0, 0.5, 1000.0};
  cell.setMotors(commands);
  EXPECT_TRUE(running.until([](Cell& c) { return c.motors()[2].position == 0.5; }));
  EXPECT_TRUE(running.until([&](Cell&) { return cell.snapshot().motors[2].position == 0.5; }));
  plant::PersonInput person;
  person.hand.position = cell.snapshot().truth.robot_hand.position - Vector3d(0.15, 0.0, 0.0);
  cell.setHuman(person);
  EXPECT_TRUE(running.until([&](Cell&) { return !cell.snapshot().refused_hand.empty(); }));
  EXPECT_NE(cell.snapshot().refused_hand.find("person's hand"), std::string::npos);
  person.hand.position = Vector3d(1.0, 0.2, 0.5);
  cell.setHuman(person);
  EXPECT_TRUE(running.until([&](Cell&) { return cell.snapshot().refused_hand.empty(); }));
  EXPECT_TRUE(running.until([](Cell& c) {
    return (c.plant().personHand().position - Vector3d(1.0, 0.2, 0.5)).norm() < 0.01;
  }));
}
