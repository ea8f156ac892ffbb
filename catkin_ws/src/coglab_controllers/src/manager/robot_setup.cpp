#include "coglab_controllers/manager/robot_setup.hpp"

#include <stdexcept>
#include <string>
#include <vector>

namespace coglab_controllers {

namespace {

constexpr double kFarthest = 10.0;  // m, largest workspace coordinate; detects numbers in mm

/// Checks that the table has the joints of the chain in the same order. @throws std::runtime_error
void requireJointsOf(const Chain& chain, const coglab_rt::JointLimits& table) {
  const std::vector<std::string>& names = chain.jointNames();
  for (std::size_t joint = 0; joint < names.size(); ++joint) {
    if (joint < table.names.size() && names[joint] == table.names[joint]) continue;
    throw std::runtime_error(
        "joint " + std::to_string(joint + 1) + " from " + chain.baseLink() + " is '" +
        names[joint] + "' in the robot description, '" +
        (joint < table.names.size() ? table.names[joint] : "") +
        "' in the table of joint limits; name the same joints in the same order in both");
  }
}

}  // namespace

std::shared_ptr<const RobotSetup> makeRobotSetup(const std::string& urdf,
                                                 const coglab_rt::JointLimits& table,
                                                 const Parameters& parameters) {
  coglab_rt::JointLimits limits = table;
  limits.upper_position = parameters.numbers("upper_joint_pos_limit", table.upper_position);
  limits.lower_position = parameters.numbers("lower_joint_pos_limit", table.lower_position);
  limits.velocity = parameters.numbers("joint_vel_limit", table.velocity);
  for (int joint = 0; joint < kMaxJoints; ++joint) {
    const bool wider = limits.upper_position[joint] > table.upper_position[joint] ||
                       limits.lower_position[joint] < table.lower_position[joint] ||
                       limits.velocity[joint] > table.velocity[joint];
    if (wider || limits.lower_position[joint] >= limits.upper_position[joint] ||
        limits.velocity[joint] <= 0.0) {
      throw std::runtime_error(
          "parameters upper_joint_pos_limit, lower_joint_pos_limit, joint_vel_limit: joint " +
          std::to_string(joint + 1) +
          " is not inside the robot's own limits (lwr_description/config/joint_limits.yaml); "
          "they may only be narrowed");
    }
  }

  GuardParameters guard;
  guard.lower_position = limits.lower_position;
  guard.upper_position = limits.upper_position;
  guard.velocity = limits.velocity;
  guard.acceleration = limits.acceleration;
  guard.jerk = limits.jerk;
  guard.position_margin =
      parameters.number("position_margin", table.position_margin, table.position_margin, 0.5);
  guard.hand_speed = parameters.number("hand_speed_limit", guard.hand_speed, 0.0, 5.0);
  guard.elbow_speed = parameters.number("elbow_speed_limit", guard.elbow_speed, 0.0, 5.0);
  const Parameters space = parameters.block("workspace");
  guard.workspace.box_min = space.numbers("box_min", guard.workspace.box_min, kFarthest);
  guard.workspace.box_max = space.numbers("box_max", guard.workspace.box_max, kFarthest);
  guard.workspace.base_centre =
      space.numbers("base_centre", guard.workspace.base_centre, kFarthest);
  guard.workspace.base_radius = space.number("base_radius", guard.workspace.base_radius, 0.0, 5.0);
  guard.workspace.max_stretch = space.number("max_stretch", guard.workspace.max_stretch, 0.2, 1.0);
  guard.workspace_deceleration =
      space.number("deceleration", guard.workspace_deceleration, 0.05, 20.0);

  const std::string tool_link = parameters.text("tool_link", "ih2_palm");
  const Chain chain(urdf, parameters.text("base_link", "lwr_base_link"), tool_link);
  requireJointsOf(chain, table);
  const Chain to_wrench(urdf, chain.baseLink(), parameters.text("wrench_link", "ih2_palm"));
  const JointVector zero = JointVector::Zero();
  const Quaternion tool_from_wrench =
      chain.evaluate(zero).tool.orientation.conjugate() * to_wrench.evaluate(zero).tool.orientation;
  const Guard check(guard, chain);  // throws here, outside the cycle
  const std::string touch_topic = parameters.text("tactile_topic", "ih2_hand/fingertip_forces");
  return std::make_shared<const RobotSetup>(
      RobotSetup{chain, limits, guard, Workspace(guard.workspace, chain.reach()), tool_from_wrench,
                 tool_link, parameters.flag("tactile", false) ? touch_topic : ""});
}

}  // namespace coglab_controllers
