// The mailbox of a signal, between another thread and the control cycle.
#include "test_support.hpp"

namespace ctrl_more {
namespace {

// Letters in every order of leaving and taking.
TEST(Mailbox, DeliversEachLetterOnceAndWhole) {
  Logger logger;
  RobotStates robot(&logger);
  robot.declare(RobotSource::Measured, "wrench", 2);
  const RobotSignal wrench = robot.find(RobotSource::Measured, "wrench");
  SignalMailbox mailbox(wrench);
  for (int i = 1; i <= 12; ++i) {
    for (int posted = 0; posted <= i % 3; ++posted) {
      const double letter[2] = {1.0 * i, 10.0 * i + posted};
      ASSERT_TRUE(mailbox.post(letter, 2, 100 * i + posted));
    }
    ASSERT_TRUE(mailbox.deliver(robot));
    for (int asked = 0; asked < 2; ++asked) {
      EXPECT_EQ(robot.view(wrench)[0], 1.0 * i);
      EXPECT_EQ(robot.view(wrench)[1], 10.0 * i + i % 3);
      EXPECT_EQ(robot.stamp(wrench), 100 * i + i % 3);
      EXPECT_FALSE(mailbox.deliver(robot)) << "there is nothing new";
    }
  }
  const double bad[2] = {1.0, std::nan("")};
  ASSERT_TRUE(mailbox.post(bad, 2, 5000));
  EXPECT_FALSE(mailbox.deliver(robot));
  EXPECT_EQ(robot.view(wrench)[0], 12.0);
}

}  // namespace
}  // namespace ctrl_more
