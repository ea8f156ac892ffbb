// Loads an installed controller by its type, runs it, and prints its effect.
#include <iostream>

#include "ctrl_more/feedback_controllers_manager.hpp"

int main() {
  using namespace ctrl_more;
  RobotStates robot;
  ControlStates control(2);
  FeedbackControllersManager manager(robot, control);
  const LoadReport report = manager.load(
      ConfigNode::fromText("loadControllers: [JointLimits]\n"
                           "JointLimits: {configFile: two_joints.yaml, enabled: true}\n",
                           "list"),
      CONSUMER_CONFIG);
  if (!report.ok()) {
    std::cerr << report.text() << '\n';
    return 1;
  }
  robot.setMeasuredData("joint_position", Eigen::Vector2d(0.95, 0.0), 0);
  control.setJointSpaceReference("Velocity", Eigen::Vector2d(1.0, 1.0));
  for (int i = 0; i < 100; ++i) {
    control.setJointSpaceReference("Velocity", Eigen::Vector2d(1.0, 1.0));
    manager.update(robot, &control);
  }
  Eigen::VectorXd velocity;
  control.getJointSpaceReference("Velocity", velocity);
  std::cout << velocity[0] << ' ' << velocity[1] << '\n';
  return 0;
}
