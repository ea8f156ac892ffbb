/// @file
/// The controller manager on ROS: services, topics and diagnostics below controller_manager (D4.10,
/// Table 6).
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64.h>
#include <tf2_ros/buffer.h>

#include "coglab_controllers/manager/control_thread.hpp"
#include "coglab_controllers/manager/controller_manager.hpp"
#include "coglab_controllers/ros/cancel_ros.hpp"
#include "coglab_controllers/ros/feedback_ros.hpp"
#include "coglab_controllers/ros/motion_controller_ros.hpp"
#include "coglab_controllers/ros/signal_topics.hpp"
#include "coglab_msgs/ControllerStatus.h"
#include "coglab_msgs/GetActiveController.h"
#include "coglab_msgs/ListControllers.h"
#include "coglab_msgs/LoadController.h"
#include "coglab_msgs/SetSpeedScale.h"
#include "coglab_msgs/SwitchController.h"
#include "coglab_msgs/UnloadController.h"

namespace coglab_controllers {

/// Owns the manager and its control thread. Mailboxes connect it to the robot: an arm in this
/// process, or topics.
class ManagerRos {
 public:
  struct Options {
    /// Publish the sent velocities for display (robot in this process). With split:=true the
    /// control thread publishes them.
    bool publish_target = true;
    ros::Publisher target;  ///< lwr/target_joint_states
    ControlThreadOptions thread;
    int highest_priority = 99;  ///< limit for the control thread, below the arm's thread
    /// Called after each switch; true if a controller is active.
    std::function<void(bool)> controller_active;
  };

  /// Reads parameters below `node` (…/controller_manager). @throws std::exception with the
  /// cause
  ManagerRos(const ros::NodeHandle& node, coglab_rt::ArmMailboxes& mailboxes, Options options);
  ~ManagerRos();
  ManagerRos(const ManagerRos&) = delete;
  ManagerRos& operator=(const ManagerRos&) = delete;

  /// Starts the control thread, the services and the publisher. Then it loads and activates the
  /// controllers of the parameters `load` and `active`.
  void start();
  /// Ends services and publisher, then the control thread.
  void shutdown();

  ControllerManager& manager() { return *manager_; }
  ControlThread& controlThread() { return *thread_; }
  /// True if a controller is active. Any thread, wait-free.
  bool controllerActive() const { return active_.load(std::memory_order_relaxed); }

 private:
  /// A motion controller and its ROS side. A pointer to it keeps both alive.
  struct Side {
    std::string id;
    std::shared_ptr<const LoadedMotion> motion;  ///< set on unloading; keeps it while in use
    std::unique_ptr<MotionControllerRos> ros;    ///< destroyed before the motion
  };

  bool onLoad(coglab_msgs::LoadController::Request& request,
              coglab_msgs::LoadController::Response& response);
  bool onUnload(coglab_msgs::UnloadController::Request& request,
                coglab_msgs::UnloadController::Response& response);
  bool onList(coglab_msgs::ListControllers::Request& request,
              coglab_msgs::ListControllers::Response& response);
  bool onSwitch(coglab_msgs::SwitchController::Request& request,
                coglab_msgs::SwitchController::Response& response);
  bool onActive(coglab_msgs::GetActiveController::Request& request,
                coglab_msgs::GetActiveController::Response& response);
  bool onSpeed(coglab_msgs::SetSpeedScale::Request& request,
               coglab_msgs::SetSpeedScale::Response& response);
  void onSpeedTopic(const std_msgs::Float64& message);
  Answer load(const std::string& id, const std::string& type);
  void detach(const std::string& id, std::shared_ptr<const LoadedMotion> motion);
  Answer switchTo(const std::string& id, std::string& type);
  void loadFromParameters();
  std::vector<std::shared_ptr<Side>> sides();
  void goalLoop();
  void publishLoop();
  void publishTarget(const CycleReport& report);
  void publishStatus(const CycleReport& report);
  void watch(const CycleReport& report);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  ros::NodeHandle node_;
  Options options_;
  ros::CallbackQueue queue_;
  std::shared_ptr<RosLogSink> log_sink_;
  std::unique_ptr<ctrl_more::Logger> logger_;
  std::unique_ptr<ControllerManager> manager_;
  std::unique_ptr<ControlThread> thread_;
  std::unique_ptr<tf2_ros::Buffer> tf_;
  std::unique_ptr<TfListener> tf_listener_;
  std::unique_ptr<FeedbackRos> feedback_;
  std::unique_ptr<CancelRos> cancel_;
  std::unique_ptr<SignalTopics> signals_;
  std::mutex sides_mutex_;
  std::vector<std::shared_ptr<Side>> sides_;
  std::vector<ros::ServiceServer> services_;
  ros::Publisher status_;
  ros::Subscriber speed_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
  std::unique_ptr<diagnostic_updater::Updater> diagnostics_;
  std::thread goals_, publisher_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> active_{false};

  // publisher thread
  CycleReport shown_;
  coglab_msgs::ControllerStatus status_shown_;
  bool shown_once_ = false;
  std::int64_t status_shown_ns_ = 0;
  std::string stalled_;
  std::uint64_t heartbeat_ = 0;
  std::int64_t heartbeat_ns_ = 0;
  std::uint64_t published_samples_ = 0;
  sensor_msgs::JointState target_message_;
};

}  // namespace coglab_controllers
