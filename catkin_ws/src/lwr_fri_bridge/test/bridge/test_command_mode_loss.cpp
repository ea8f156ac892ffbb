/// Causes of a loss of command mode, and automatic restarts: bridge and small controller in
/// lockstep, with the restart logic of BridgeRos.
#include <gtest/gtest.h>

#include "bridge_cell.hpp"
#include "lwr_fri_bridge/bridge/diagnosis.hpp"

namespace lwr_fri_bridge {
namespace {

using test::Cell;

constexpr double kPeriod = 0.005;

/// The bridge, and the decision about a restart.
struct Watched : Cell {
  Watched() : Cell(kPeriod) { bridge.setControllerHere(true); }

  /// Runs cycles with the restart logic. Returns the number of requested starts.
  int watch(int cycles) {
    int asked = 0;
    for (int i = 0; i < cycles; ++i) {
      run(1);
      const Snapshot s = bridge.snapshot();
      QuietRestart::View view;
      view.loss = s.loss;
      view.stopped = s.supervisor == SupervisorState::Stopped;
      view.held = s.hold_latched;
      view.may_command = s.quality >= fri::Quality::Ok && s.drive_error == 0;
      view.timestamp = s.timestamp;
      view.position = s.sample.position;
      view.velocity = s.sample.velocity;
      if (!restart.due(view, robot.now())) continue;
      ++asked;
      bridge.submit("start");
    }
    return asked;
  }

  /// The controller is not run for `seconds`; the bridge's idle ticks go on.
  void stall(double seconds) {
    const std::int64_t from = robot.now();
    for (std::int64_t t = 0; t <= static_cast<std::int64_t>(1e9 * seconds); t += 10'000'000)
      bridge.idle(from + t);
    robot.wait(seconds);
  }

  std::string reason() {
    const Snapshot s = bridge.snapshot();
    return reasonOf(s.sample.block, s.sample.blocking_joint, s.loss);
  }

  QuietRestart restart;
};

TEST(CommandModeLoss, AStalledControllerOnThisComputerIsNamedAndStartedAgainAtRest) {
  Watched cell;
  cell.start();
  EXPECT_EQ(cell.watch(200), 0);
  cell.stall(0.4);
  EXPECT_EQ(cell.bridge.snapshot().loss.cause, LossCause::ControllerStalled);
  const std::uint32_t epoch = cell.bridge.snapshot().sample.motion_epoch;
  // What was commanded before does not count after the restart.
  cell.bridge.mailboxes().sendVelocity({Vector7::Constant(0.3), cell.robot.now(), epoch});
  const Vector7 stood = cell.robot.setPoint();
  cell.run(1);
  EXPECT_EQ(cell.bridge.snapshot().sample.block, MotionBlock::NotStarted);
  EXPECT_NE(cell.reason().find("not run"), std::string::npos) << cell.reason();
  EXPECT_STREQ(nextEvent(cell.bridge.snapshot().sample.block), "start");
  EXPECT_EQ(cell.watch(200), 1);
  const Snapshot after = cell.bridge.snapshot();
  EXPECT_EQ(after.supervisor, SupervisorState::Command);
  EXPECT_EQ(after.loss.cause, LossCause::None);
  EXPECT_NE(after.sample.motion_epoch, epoch);
  EXPECT_LT((cell.robot.setPoint() - stood).norm(), 1e-6);
  EXPECT_TRUE(cell.reason().empty());
}

TEST(CommandModeLoss, ALateFriThreadIsNamedAndStartedAgainAtRest) {
  Watched cell;
  cell.bridge.setControllerHere(false);
  cell.start();
  cell.run(200);
  for (int i = 0; i < 8; ++i) cell.robot.cycle(cell.bridge, true);
  cell.bridge.noteLate(8 * kPeriod);
  cell.robot.state = fri::FriState::Monitor;
  cell.run(1);
  EXPECT_EQ(cell.bridge.snapshot().loss.cause, LossCause::ComputerLate);
  EXPECT_NE(cell.reason().find("ms late"), std::string::npos) << cell.reason();
  EXPECT_EQ(cell.watch(400), 1);
  EXPECT_EQ(cell.bridge.snapshot().supervisor, SupervisorState::Command);
}

}  // namespace
}  // namespace lwr_fri_bridge
