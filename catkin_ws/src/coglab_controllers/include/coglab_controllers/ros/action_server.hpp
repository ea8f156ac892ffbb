/// @file
/// An action server that works with any stamp from a client.
#pragma once

#include <actionlib/server/action_server_base.h>
#include <actionlib_msgs/GoalID.h>
#include <actionlib_msgs/GoalStatusArray.h>
#include <ros/ros.h>

namespace coglab_controllers {

/// Implements the protocol of actionlib with actionlib's own logic of goals, but removes stamps of
/// goals and cancels that are ahead of the clock. In actionlib::ActionServer such a stamp can
/// overflow and end the process. As the newest cancel it would refuse every later goal.
template <typename Action>
class ActionServer : public actionlib::ActionServerBase<Action> {
  using Base = actionlib::ActionServerBase<Action>;
  ACTION_DEFINITION(Action)

 public:
  using GoalHandle = typename Base::GoalHandle;
  using Callback = boost::function<void(GoalHandle)>;

  /// Serves below `name`; the queue of `node` runs the callbacks. Call start() next.
  ActionServer(const ros::NodeHandle& node, const std::string& name, Callback on_goal,
               Callback on_cancel)
      : Base(std::move(on_goal), std::move(on_cancel)), node_(node, name) {}

  ~ActionServer() override {
    timer_.stop();
    goals_.shutdown();
    cancels_.shutdown();
  }

 protected:
  void onGoal(const boost::shared_ptr<const ActionGoal>& goal) {
    const ros::Time now = ros::Time::now();
    forgetCancelAfter(now);
    if (goal->goal_id.stamp <= now) return this->goalCallback(goal);
    auto believable = boost::make_shared<ActionGoal>(*goal);
    believable->goal_id.stamp = now;
    this->goalCallback(believable);
  }

  void onCancel(const boost::shared_ptr<const actionlib_msgs::GoalID>& cancel) {
    const ros::Time now = ros::Time::now();
    if (cancel->stamp <= now) return this->cancelCallback(cancel);
    auto believable = boost::make_shared<actionlib_msgs::GoalID>(*cancel);
    believable->stamp = now;
    this->cancelCallback(believable);
  }

 private:
  static constexpr double kStatusPeriod = 0.2;  // s
  static constexpr double kKept =
      5.0;  // s, time for which the status of an ended goal is published

  void initialize() override {
    results_ = node_.template advertise<ActionResult>("result", 50);
    feedback_ = node_.template advertise<ActionFeedback>("feedback", 50);
    status_ = node_.template advertise<actionlib_msgs::GoalStatusArray>("status", 50, true);
    this->status_list_timeout_ = ros::Duration(kKept);
    goals_ = node_.template subscribe<ActionGoal>("goal", 50, &ActionServer::onGoal, this);
    cancels_ = node_.template subscribe<actionlib_msgs::GoalID>("cancel", 50,
                                                                &ActionServer::onCancel, this);
    timer_ = node_.createSteadyTimer(ros::WallDuration(kStatusPeriod),
                                     [this](const ros::SteadyTimerEvent&) {
                                       forgetOldGoals();
                                       publishStatus();
                                     });
  }

  /// If the clock stepped back, the newest cancel would refuse every goal until its time returns.
  void forgetCancelAfter(const ros::Time& now) {
    const boost::recursive_mutex::scoped_lock lock(this->lock_);
    if (this->last_cancel_ > now) this->last_cancel_ = ros::Time();
  }

  void publishResult(const actionlib_msgs::GoalStatus& status, const Result& result) override {
    ActionResult message;
    message.header.stamp = ros::Time::now();
    message.status = status;
    message.result = result;
    results_.publish(message);
    publishStatus();
  }

  void publishFeedback(const actionlib_msgs::GoalStatus& status,
                       const Feedback& feedback) override {
    ActionFeedback message;
    message.header.stamp = ros::Time::now();
    message.status = status;
    message.feedback = feedback;
    feedback_.publish(message);
  }

  void publishStatus() override {
    const boost::recursive_mutex::scoped_lock lock(this->lock_);
    actionlib_msgs::GoalStatusArray message;
    message.header.stamp = ros::Time::now();
    for (const auto& goal : this->status_list_) message.status_list.push_back(goal.status_);
    status_.publish(message);
  }

  /// Only the timer removes goals: actionlib goes through the list while it publishes a result.
  void forgetOldGoals() {
    const boost::recursive_mutex::scoped_lock lock(this->lock_);
    const ros::Time now = ros::Time::now();
    this->status_list_.remove_if([&](const auto& goal) {
      return !goal.handle_destruction_time_.isZero() &&
             goal.handle_destruction_time_ + this->status_list_timeout_ < now;
    });
  }

  ros::NodeHandle node_;
  ros::Publisher results_, feedback_, status_;
  ros::Subscriber goals_, cancels_;
  ros::SteadyTimer timer_;
};

}  // namespace coglab_controllers
