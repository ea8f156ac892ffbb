// /robot: the arm's interface and the controller manager in one process, coupled in memory (D4.10:
// "in a single ROS component on top of the robot HAL component, to avoid delays inherent to the IPC
// mechanisms"). Which arm: the parameter lwr/arm.
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

#include <ros/ros.h>
#include <sensor_msgs/JointState.h>

#include "coglab_controllers/ideal/ideal_arm_ros.hpp"
#include "coglab_controllers/ros/manager_ros.hpp"
#include "coglab_rt/arm_library.hpp"
#include "coglab_rt/arm_port.hpp"
#include "coglab_rt/ros/exit_limit.hpp"
#include "coglab_rt/ros/logger_service.hpp"
#include "coglab_rt/ros/node_start.hpp"
#include "coglab_rt/ros/parameter.hpp"
#include "lwr_fri_bridge/ros/bridge_ros.hpp"

namespace {

volatile std::sig_atomic_t asked_to_end = 0;
void onSignal(int) { asked_to_end = 1; }

/// Makes a back end by its name or library. @throws std::exception naming a parameter
std::unique_ptr<coglab_rt::ArmPort> makeArm(const ros::NodeHandle& lwr, const std::string& name) {
  if (name == "fri") return std::make_unique<lwr_fri_bridge::BridgeRos>(lwr, true);
  if (name == "ideal") return std::make_unique<coglab_controllers::IdealArmRos>(lwr);
  if (name.find(".so") != std::string::npos) return coglab_rt::loadArm(name);
  throw std::invalid_argument(
      "parameter " + lwr.resolveName("arm") + " = '" + name +
      "': expected fri, ideal or the file of a library, such as libmy_arm.so");
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "robot", ros::init_options::NoSigintHandler);
  if (!coglab_rt::nameIsFree()) return 1;
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  try {
    ros::NodeHandle root;
    coglab_rt::LoggerServices logger_services;
    ros::NodeHandle lwr("lwr");
    std::atomic<coglab_controllers::ControlThread*> control{nullptr};
    const auto name =
        coglab_rt::readParameter<std::string>(lwr, "arm", "fri", "fri, ideal or a library");
    const std::unique_ptr<coglab_rt::ArmPort> arm = makeArm(lwr, name);
    try {
      arm->start([&control](bool measured) {
        if (auto* thread = control.load(std::memory_order_acquire)) thread->wake(measured);
      });
    } catch (const std::exception& error) {
      throw std::runtime_error("the arm " + name + " cannot be started: " + error.what());
    }

    coglab_controllers::ManagerRos::Options options;
    options.target = lwr.advertise<sensor_msgs::JointState>("target_joint_states", 10);
    options.controller_active = [&arm](bool active) { arm->setControllerActive(active); };
    options.highest_priority = arm->highestPriority();
    coglab_controllers::ManagerRos manager(ros::NodeHandle("controller_manager"), arm->mailboxes(),
                                           options);
    // At every exit from this scope the arm brakes while the control thread still runs, and the
    // arm's thread, which wakes the control thread, ends before the manager is destroyed.
    const std::shared_ptr<void> ends_first(nullptr, [&arm](void*) { arm->shutdown(); });
    control.store(&manager.controlThread(), std::memory_order_release);
    manager.start();
    while (ros::ok() && asked_to_end == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    arm->shutdown();
    coglab_rt::endProcessWithin(std::chrono::seconds(1));
    arm->unregister();
    manager.shutdown();
    ros::shutdown();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    std::fprintf(stderr, "robot_node: %s\n", error.what());
    return 1;
  }
  return 0;
}
