// The controller manager as a separate node (split:=true), with the topics joint_states and
// target_joint_states.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <exception>
#include <thread>

#include <ros/callback_queue.h>
#include <ros/ros.h>

#include "coglab_controllers/ros/manager_ros.hpp"
#include "coglab_controllers/ros/robot_topics.hpp"
#include "coglab_controllers/ros/ros_parameters.hpp"
#include "coglab_rt/ros/exit_limit.hpp"
#include "coglab_rt/ros/logger_service.hpp"
#include "coglab_rt/ros/node_start.hpp"
#include "coglab_rt/ros/parameter.hpp"

namespace {
volatile std::sig_atomic_t asked_to_end = 0;
void onSignal(int) { asked_to_end = 1; }
}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "controller_manager", ros::init_options::NoSigintHandler);
  if (!coglab_rt::nameIsFree()) return 1;
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  try {
    ros::NodeHandle robot(coglab_rt::readParameter<std::string>(ros::NodeHandle("~"),
                                                                "arm_namespace", "lwr", "a name"));
    coglab_rt::LoggerServices logger_services;
    ros::CallbackQueue queue;  // one thread: the writer of the samples
    robot.setCallbackQueue(&queue);
    std::atomic<coglab_controllers::ControlThread*> control{nullptr};
    const ros::NodeHandle manager_node("controller_manager");
    coglab_controllers::RobotTopics topics(
        robot, coglab_controllers::readJointLimits(manager_node), [&control] {
          if (auto* thread = control.load(std::memory_order_acquire)) thread->wake(true);
        });
    std::atomic<coglab_controllers::ManagerRos*> ready{nullptr};
    coglab_controllers::ManagerRos::Options options;
    options.publish_target = false;
    // Both may run on one computer, and the answers to the robot have priority.
    options.highest_priority =
        std::max(0, coglab_rt::readParameter(robot, "rt_priority", 80, "a whole number") - 1);
    options.thread.after_cycle = [&](const coglab_controllers::VelocityCommand& command) {
      // Without an active controller others may use the topic.
      const auto* manager = ready.load(std::memory_order_acquire);
      if (manager != nullptr && manager->controllerActive()) topics.send(command);
    };
    coglab_controllers::ManagerRos manager(manager_node, topics.mailboxes(), options);
    ready.store(&manager, std::memory_order_release);
    control.store(&manager.controlThread(), std::memory_order_release);
    ros::AsyncSpinner spinner(1, &queue);
    spinner.start();
    manager.start();
    while (ros::ok() && asked_to_end == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    spinner.stop();
    coglab_rt::endProcessWithin(std::chrono::seconds(1));
    manager.shutdown();
    ros::shutdown();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    std::fprintf(stderr, "controller_manager_node: %s\n", error.what());
    return 1;
  }
  return 0;
}
