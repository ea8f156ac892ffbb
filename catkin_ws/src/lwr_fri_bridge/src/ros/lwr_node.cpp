/// @file
/// The bridge as a separate node (split:=true), with target velocities from target_joint_states.
/// The default is robot_node of coglab_controllers, with bridge and controller manager in one
/// process.
#include <atomic>
#include <chrono>
#include <csignal>
#include <thread>

#include <ros/ros.h>

#include "coglab_rt/ros/exit_limit.hpp"
#include "coglab_rt/ros/logger_service.hpp"
#include "coglab_rt/ros/node_start.hpp"
#include "coglab_rt/ros/parameter.hpp"
#include "lwr_fri_bridge/ros/bridge_ros.hpp"

namespace {

std::atomic<bool> interrupted{false};

void onSignal(int) { interrupted = true; }

}  // namespace

int main(int argc, char** argv) {
  // Own signal handlers: the arm must come to rest before the node ends.
  ros::init(argc, argv, "lwr", ros::init_options::NoSigintHandler);
  if (!coglab_rt::nameIsFree()) return 1;
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  // Destroyed last, because ROS logs errors only while a handle exists.
  const ros::NodeHandle own("~");
  coglab_rt::LoggerServices logger_services;
  try {
    const ros::NodeHandle nh(
        coglab_rt::readParameter<std::string>(own, "lwr_namespace", "lwr", "a name"));
    lwr_fri_bridge::BridgeRos bridge(nh, false);
    bridge.start({});
    ros::AsyncSpinner spinner(1);
    spinner.start();
    while (!interrupted && ros::ok()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    bridge.shutdown();
    coglab_rt::endProcessWithin(std::chrono::seconds(1));
    bridge.unregister();
    ros::shutdown();
  } catch (const std::exception& error) {
    ROS_FATAL("lwr: %s", error.what());
    ros::shutdown();
    return 1;
  }
  ros::shutdown();
  return 0;
}
