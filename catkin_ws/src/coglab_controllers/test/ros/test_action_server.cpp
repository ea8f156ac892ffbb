// The action server across steps of the clock. It needs no ROS master, as it never starts its
// topics.
#include <memory>
#include <string>
#include <vector>

#include <actionlib/TestAction.h>
#include <gtest/gtest.h>

#include "coglab_controllers/ros/action_server.hpp"

namespace coglab_controllers {
namespace {

struct Server : ActionServer<actionlib::TestAction> {
  using Base = ActionServer<actionlib::TestAction>;

  Server()
      : Base(
            ros::NodeHandle(), "work",
            [this](GoalHandle goal) { begun.push_back(goal.getGoalID().id); }, [](GoalHandle) {}) {
    started_ = true;
  }
  void send(const std::string& id, double stamp) {
    const auto goal = boost::make_shared<actionlib::TestActionGoal>();
    goal->goal_id.id = id;
    goal->goal_id.stamp = ros::Time(stamp);
    onGoal(goal);
  }
  void cancel(double stamp) {
    const auto cancel = boost::make_shared<actionlib_msgs::GoalID>();
    cancel->stamp = ros::Time(stamp);
    onCancel(cancel);
  }

  std::vector<std::string> begun;

 private:
  void publishResult(const actionlib_msgs::GoalStatus&, const actionlib::TestResult&) override {}
  void publishStatus() override {}
};

using Ids = std::vector<std::string>;

struct GoalsAndClock : ::testing::Test {
  static void SetUpTestSuite() {
    ros::master::setRetryTimeout(ros::WallDuration(0.01));  // there is none
    ros::init(ros::M_string{{"__master", "http://127.0.0.1:9"}}, "goals_and_clock",
              ros::init_options::NoSigintHandler | ros::init_options::NoRosout);
    keep = std::make_unique<ros::NodeHandle>();
  }
  static void TearDownTestSuite() {
    keep.reset();
    ros::Time::init();
  }
  static inline std::unique_ptr<ros::NodeHandle> keep;  // the end of the last one would end ROS

  GoalsAndClock() { ros::Time::setNow(ros::Time(1000.0)); }

  Server server;
};

TEST_F(GoalsAndClock, ACancelWithAStampRefusesOnlyOlderGoals) {
  server.cancel(900.0);
  server.send("old", 800.0);
  server.send("new", 1000.0);
  EXPECT_EQ(server.begun, Ids{"new"});
}

TEST_F(GoalsAndClock, AGoalBeginsAfterACancelFromTheFuture) {
  server.cancel(4e9);
  ros::Time::setNow(ros::Time(1001.0));
  server.send("new", 1001.0);
  EXPECT_EQ(server.begun, Ids{"new"});
}

TEST_F(GoalsAndClock, AGoalBeginsAfterACancelAndAClockThatIsSetBack) {
  server.cancel(1000.0);
  ros::Time::setNow(ros::Time(400.0));
  server.send("new", 400.0);
  EXPECT_EQ(server.begun, Ids{"new"});
}

}  // namespace
}  // namespace coglab_controllers
