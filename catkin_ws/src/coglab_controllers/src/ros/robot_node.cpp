// /robot: the arm's interface and the controller manager in one process, coupled in memory (D4.10:
// "in a single ROS component on top of the robot HAL component, to avoid delays inherent to the IPC
// mechanisms").
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <exception>
#include <memory>
#include <thread>

#include <ros/ros.h>
#include <sensor_msgs/JointState.h>

#include "coglab_controllers/ros/manager_ros.hpp"
#include "lwr_fri_bridge/bridge_ros.hpp"
#include "lwr_fri_bridge/exit_limit.hpp"
#include "lwr_fri_bridge/logger_service.hpp"

namespace {
volatile std::sig_atomic_t asked_to_end = 0;
void onSignal(int) { asked_to_end = 1; }
}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "robot", ros::init_options::NoSigintHandler);
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  try {
    ros::NodeHandle root;
    lwr_fri_bridge::LoggerServices logger_services;
    ros::NodeHandle lwr("lwr");
    std::atomic<coglab_controllers::ControlThread*> control{nullptr};
    lwr_fri_bridge::BridgeRos::Options bridge_options;
    bridge_options.one_process = true;
    bridge_options.after_answer = [&control](bool answered) {
      if (auto* thread = control.load(std::memory_order_acquire)) thread->wake(answered);
    };
    lwr_fri_bridge::BridgeRos bridge(lwr, bridge_options);
    bridge.start();

    coglab_controllers::ManagerRos::Options options;
    options.target = lwr.advertise<sensor_msgs::JointState>("target_joint_states", 10);
    options.controller_active = [&bridge](bool active) { bridge.setControllerActive(active); };
    options.highest_priority = bridge.priorityBelow();
    coglab_controllers::ManagerRos manager(ros::NodeHandle("controller_manager"), bridge.port(),
                                           options);
    // However this scope ends: the bridge brakes and leaves command mode while the control thread
    // still runs, and the FRI thread, which wakes the control thread, ends before the manager goes.
    const std::shared_ptr<void> ends_first(nullptr, [&bridge](void*) { bridge.shutdown(); });
    control.store(&manager.controlThread(), std::memory_order_release);
    manager.start();
    while (ros::ok() && asked_to_end == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    bridge.shutdown();
    lwr_fri_bridge::endProcessWithin(std::chrono::seconds(1));
    bridge.unregister();
    manager.shutdown();
    ros::shutdown();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    std::fprintf(stderr, "robot_node: %s\n", error.what());
    return 1;
  }
  return 0;
}
