/// Stamps and the steady clock: there and back, and for any stamp that a wire can carry.
#include <gtest/gtest.h>

#include <cstdint>
#include <random>

#include <ros/time.h>

#include "coglab_rt/ros/ros_time.hpp"

namespace coglab_rt {
namespace {

constexpr std::int64_t kJitter_ns = 500'000'000;  // between two readings on a busy machine

/// The last test leaves simulated time behind.
class RosTime : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { ros::Time::init(); }
};

TEST_F(RosTime, AnyStampHasAnAge) {
  std::mt19937 random(5);
  for (int i = 0; i < 10000; ++i) {
    ros::Time stamp;
    stamp.sec = static_cast<std::uint32_t>(random());
    stamp.nsec = static_cast<std::uint32_t>(random());
    EXPECT_NO_THROW(ageOf(stamp));
    if (!stamp.isZero()) {
      const std::int64_t now = steadyNow();
      EXPECT_NEAR(static_cast<double>(now - toSteady(stamp, now) - ageOf(stamp)), 0.0, kJitter_ns);
    }
  }
}

TEST_F(RosTime, ZeroMeansNoStampAndIsNeverMade) {
  EXPECT_EQ(toSteady(ros::Time()), 0);
  ros::Time::setNow(ros::Time(3.0));  // simulated time has just begun
  EXPECT_EQ(toRos(steadyNow() - 10'000'000'000), ros::Time(3.0));
  EXPECT_NEAR(toRos(steadyNow() - 1'000'000'000).toSec(), 2.0, 0.5);
}

TEST(RosTimeValues, SecondsAndNanosecondsAreOneNumber) {
  EXPECT_EQ(nanoseconds(ros::Time(3, 5)), 3'000'000'005);
  EXPECT_EQ(nanoseconds(ros::Time(4294967295U, 999'999'999)), 4'294'967'295'999'999'999);
  ros::Time::setNow(ros::Time(7, 250));
  EXPECT_EQ(ageOf(ros::Time(5, 200)), 2'000'000'050);
  EXPECT_EQ(ageOf(ros::Time(9, 250)), -2'000'000'000);
  EXPECT_EQ(toSteady(ros::Time(5, 200), 10'000'000'000), 7'999'999'950);
  EXPECT_EQ(toSteady(ros::Time(9, 250), 10'000'000'000), 12'000'000'000);
}

}  // namespace
}  // namespace coglab_rt
