#include <limits>
#include <sstream>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

struct RobotStatesTest : ::testing::Test {
  Logger logger;
  std::shared_ptr<ListSink> sink = std::make_shared<ListSink>();
  RobotStates robot{&logger};
  RobotStatesTest() { logger.addSink(sink); }
};

TEST_F(RobotStatesTest, KeepsDataAndStampOfBothMaps) {
  ASSERT_TRUE(robot.setMeasuredData("imu", vectorOf({1, 2, 3}), 42));
  ASSERT_TRUE(robot.setEstimatedData("imu", vectorOf({4, 5}), 43));
  Eigen::VectorXd value;
  std::int64_t stamp = 0;
  ASSERT_TRUE(robot.getMeasuredData("imu", value, stamp));
  EXPECT_EQ(value, vectorOf({1, 2, 3}));
  EXPECT_EQ(stamp, 42);
  ASSERT_TRUE(robot.getEstimatedData("imu", value, stamp));
  EXPECT_EQ(value, vectorOf({4, 5}));
  EXPECT_EQ(stamp, 43);
  EXPECT_EQ(robot.newestStamp(), 43);
}

TEST_F(RobotStatesTest, WrongSizeIsRefusedWithKeySizesAndCaller) {
  robot.setMeasuredData("imu", vectorOf({1, 2, 3, 4, 5, 6, 7, 8, 9}), 0);
  const Status status = robot.setMeasuredData("imu", vectorOf({1, 2, 3}), 1, "driver");
  ASSERT_FALSE(status);
  for (const char* part : {"imu", "9", "3", "driver"}) {
    EXPECT_TRUE(contains(status.message(), part)) << status.message();
  }
  Eigen::VectorXd value;
  robot.getMeasuredData("imu", value);
  EXPECT_EQ(value.size(), 9);
  logger.drain();
  EXPECT_TRUE(sink->contains("WARN"));
}

TEST_F(RobotStatesTest, MissingKeyIsAnErrorAndTheValueStays) {
  robot.setMeasuredData("imu", vectorOf({1}), 0);
  Eigen::VectorXd value = vectorOf({7, 7});
  std::int64_t stamp = 5;
  const Status status = robot.getMeasuredData("imuu", value, stamp, "test");
  ASSERT_FALSE(status);
  EXPECT_TRUE(contains(status.message(), "did you mean 'imu'")) << status.message();
  EXPECT_EQ(value, vectorOf({7, 7}));
  EXPECT_EQ(stamp, 5);
  EXPECT_FALSE(robot.getEstimatedData("imu", value));
}

TEST_F(RobotStatesTest, StampWithoutDataIsRefused) {
  EXPECT_FALSE(robot.setMeasurementTimeStamp("imu", 1));
  EXPECT_FALSE(robot.setEstimateTimeStamp("zmp", 1));
  robot.setMeasuredData("imu", vectorOf({1}), 0);
  EXPECT_TRUE(robot.setMeasurementTimeStamp("imu", 9));
  EXPECT_FALSE(robot.setEstimateTimeStamp("imu", 9)) << "the key is in the other map";
  EXPECT_EQ(robot.stamp(robot.find(RobotSource::Measured, "imu")), 9);
}

TEST_F(RobotStatesTest, BadNumbersAndStampsAreRefused) {
  robot.setMeasuredData("imu", vectorOf({1}), 0);
  EXPECT_FALSE(robot.setMeasuredData("imu", vectorOf({std::nan("")}), 1));
  EXPECT_FALSE(
      robot.setMeasuredData("imu", vectorOf({std::numeric_limits<double>::infinity()}), 1));
  EXPECT_FALSE(robot.setMeasuredData("imu", vectorOf({2}), -1));
  const RobotSignal imu = robot.find(RobotSource::Measured, "imu");
  const double nan = std::nan("");
  EXPECT_FALSE(robot.write(imu, &nan, 3));
  EXPECT_FALSE(robot.write(RobotSignal(), &nan, 3));
  EXPECT_EQ(robot.view(imu)[0], 1.0);
  EXPECT_EQ(robot.stamp(imu), 0);
}

TEST_F(RobotStatesTest, CopyHasEverything) {
  robot.setMeasuredData("imu", vectorOf({1, 2}), 3);
  const RobotSignal imu = robot.find(RobotSource::Measured, "imu");
  const RobotStates copy = robot;
  robot.setMeasuredData("imu", vectorOf({8, 9}), 4);
  EXPECT_EQ(copy.view(imu)[0], 1.0);
  EXPECT_EQ(copy.stamp(imu), 3);
  EXPECT_EQ(copy.find(RobotSource::Measured, "imu").size(), 2);
}

TEST_F(RobotStatesTest, FrozenRefusesNewKeysOnly) {
  robot.setMeasuredData("imu", vectorOf({1}), 0);
  robot.freeze();
  EXPECT_TRUE(robot.setMeasuredData("imu", vectorOf({2}), 1));
  const Status status = robot.setMeasuredData("wrench", vectorOf({2}), 1);
  EXPECT_FALSE(status);
  EXPECT_TRUE(contains(status.message(), "frozen"));
  EXPECT_FALSE(robot.find(RobotSource::Measured, "wrench").valid());
}

TEST_F(RobotStatesTest, NeverWrittenIsAStateOfItsOwn) {
  ASSERT_TRUE(robot.declare(RobotSource::Measured, "imu", 9, "rad", "imu"));
  const RobotSignal imu = robot.find(RobotSource::Measured, "imu");
  EXPECT_EQ(robot.stamp(imu), kNeverWritten);
  EXPECT_FALSE(robot.isFresh(imu, 0, INT64_MAX));
  robot.setMeasuredData("imu", Eigen::VectorXd::Zero(9), 0);
  EXPECT_TRUE(robot.isFresh(imu, 10, 10));
  EXPECT_FALSE(robot.isFresh(imu, 11, 10));
  EXPECT_FALSE(robot.declare(RobotSource::Measured, "imu", 10));
}

TEST_F(RobotStatesTest, PrintShowsKeySizeUnitAgeAndNumbers) {
  robot.declare(RobotSource::Measured, "imu", 2, "rad", "imu_link");
  robot.declare(RobotSource::Estimated, "zmp", 3);
  robot.setMeasuredData("imu", vectorOf({1.5, 2}), 1000000);
  std::ostringstream out;
  robot.print(out, 3000000);
  EXPECT_EQ(out.str(),
            "measuredData\n  imu [2] (rad) in imu_link, age 2 ms: 1.5 2\n"
            "estimatedData\n  zmp [3]: never written\n");
}

TEST_F(RobotStatesTest, StampsOfAnotherClockAreNotFresh) {
  robot.declare(RobotSource::Measured, "imu", 1);
  const RobotSignal imu = robot.find(RobotSource::Measured, "imu");
  const std::int64_t now = 1'000'000'000'000, ms = 1'000'000;
  const auto fresh = [&](std::int64_t stamp, std::int64_t max_age) {
    const double value = 1.0;
    robot.write(imu, &value, stamp);
    return robot.isFresh(imu, now, max_age);
  };
  for (const std::int64_t age : {10 * ms, std::int64_t{INT64_MAX}}) {
    EXPECT_TRUE(fresh(now, age));
    EXPECT_TRUE(fresh(now + 50 * ms, age)) << "the clock was read a little later";
    EXPECT_FALSE(fresh(now + 50 * ms + 1, age));
    EXPECT_FALSE(fresh(INT64_MAX, age));
    EXPECT_TRUE(fresh(now - 10 * ms, age));
    EXPECT_EQ(fresh(now - 10 * ms - 1, age), age == INT64_MAX);
    EXPECT_EQ(fresh(0, age), age == INT64_MAX);
  }
}

TEST_F(RobotStatesTest, DeclaredSignalsReadAsZerosAndAreAnnouncedOnce) {
  ASSERT_TRUE(robot.declare(RobotSource::Measured, "imu", 3));
  ASSERT_TRUE(robot.declare(RobotSource::Measured, "imu", 3, "rad", "imu_link"));
  EXPECT_EQ(robot.view(robot.find(RobotSource::Measured, "imu")), vectorOf({0, 0, 0}));
  EXPECT_EQ(robot.signals(RobotSource::Measured)[0].unit, "rad");
  logger.drain();
  ASSERT_EQ(sink->lines.size(), 1u);
  EXPECT_TRUE(contains(sink->lines[0], "measuredData/imu of size 3"));
}

// Letters in every order of leaving and taking.
TEST(Mailbox, DeliversEachLetterOnceAndWhole) {
  Logger logger;
  RobotStates robot(&logger);
  robot.declare(RobotSource::Measured, "wrench", 2);
  const RobotSignal wrench = robot.find(RobotSource::Measured, "wrench");
  SignalMailbox mailbox(wrench);
  const double three[3] = {};
  EXPECT_FALSE(mailbox.post(three, 3, 1));
  EXPECT_FALSE(mailbox.deliver(robot));
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
