#include "coglab_controllers/ros/touch_topic.hpp"

#include <cmath>
#include <stdexcept>

#include "coglab_rt/ros/parameter.hpp"
#include "coglab_rt/ros/ros_time.hpp"

namespace coglab_controllers {
namespace {

constexpr int kFingers = 5;

void add(TouchForces& forces, int place, const geometry_msgs::Vector3& force) {
  if (!std::isfinite(force.x) || !std::isfinite(force.y) || !std::isfinite(force.z))
    throw std::invalid_argument("expected finite forces, got one that is not");
  const auto first = static_cast<std::size_t>(3 * place);
  forces[first] += force.x;
  forces[first + 1] += force.y;
  forces[first + 2] += force.z;
}

}  // namespace

TouchForces touchForcesOf(const coglab_msgs::FingertipForces& message, const std::string& tool) {
  if (message.header.frame_id != tool)
    throw std::invalid_argument("expected forces in the frame " + tool + ", got '" +
                                message.header.frame_id + "'");
  if (message.fingers.size() != message.forces.size())
    throw std::invalid_argument("expected a finger for each of " +
                                std::to_string(message.forces.size()) + " forces, got " +
                                std::to_string(message.fingers.size()));
  TouchForces forces{};
  for (std::size_t i = 0; i < message.forces.size(); ++i) {
    const int finger = message.fingers[i];
    if (finger < 0 || finger >= kFingers)
      throw std::invalid_argument("expected fingers 0 .. 4, got " + std::to_string(finger));
    add(forces, finger, message.forces[i]);
  }
  add(forces, kFingers, message.palm);
  return forces;
}

TouchTopic::TouchTopic(const ros::NodeHandle& node, ControllerManager& manager)
    : manager_(manager),
      node_(ros::names::parentNamespace(node.getNamespace())),
      tool_(coglab_rt::readParameter<std::string>(node, "tool_link", "ih2_palm", "a name")) {
  node_.setCallbackQueue(node.getCallbackQueue());
  const auto topic = coglab_rt::readParameter<std::string>(node, "tactile_topic",
                                                           "ih2_hand/fingertip_forces", "a name");
  forces_ =
      node_.subscribe(topic, 1, &TouchTopic::onForces, this, ros::TransportHints().tcpNoDelay());
  ROS_INFO("touch sensors: %s", forces_.getTopic().c_str());
}

void TouchTopic::onForces(const coglab_msgs::FingertipForces& message) {
  try {
    manager_.postTouch(touchForcesOf(message, tool_), coglab_rt::toSteady(message.header.stamp));
  } catch (const std::invalid_argument& error) {
    ROS_WARN_THROTTLE(1.0, "%s ignored: %s", forces_.getTopic().c_str(), error.what());
  }
}

}  // namespace coglab_controllers
