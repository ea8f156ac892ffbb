#include "coglab_sim/krc/command_checks.hpp"

#include <cmath>

namespace coglab_sim::krc {

namespace fri = lwr_fri_bridge::fri;

namespace {

constexpr const char* kJointNames[7] = {"A1", "A2", "E1", "A3", "A4", "A5", "A6"};

template <std::size_t N>
bool allFinite(const float (&values)[N]) {
  for (const float value : values) {
    if (!std::isfinite(value)) return false;
  }
  return true;
}

template <std::size_t N>
bool allWithin(const float (&values)[N], std::size_t first, std::size_t last, double low,
               double high) {
  for (std::size_t i = first; i < last; ++i) {
    if (!(values[i] >= low && values[i] <= high)) return false;
  }
  return true;
}

/// Values that no strategy accepts, in the first command and later.
std::string checkValues(const CheckContext& context, const fri::CommandDatagram& command) {
  const Parameters& p = context.parameters;
  const std::uint32_t flags = command.flags;
  if ((flags & fri::kJointVelocity) != 0 || (flags & fri::kCartesianVelocity) != 0) {
    return "cmdFlags: velocity is not supported";
  }
  Pose frame;
  if ((flags & fri::kJointPosition) != 0 && !allFinite(command.joint_position)) {
    return "cmd.jntPos not properly initialized";
  }
  if ((flags & fri::kCartesianPosition) != 0 &&
      !poseFromWire(command.cartesian_frame, p.frame_orthonormality, frame)) {
    return "cmd.cartPos not properly initialized";
  }
  if ((flags & fri::kJointTorque) != 0) {
    if (!allFinite(command.joint_torque)) return "cmd.addJntTrq not properly initialized";
    for (int i = 0; i < 7; ++i) {
      if (std::abs(command.joint_torque[i] - context.last_torque[i]) > p.torque_tolerance) {
        return "cmd.addJntTrq not properly initialized";
      }
    }
  }
  if ((flags & fri::kCartesianForce) != 0 && !allFinite(command.cartesian_force)) {
    return "cmd.addTcpFT not properly initialized";
  }
  if ((flags & fri::kJointStiffness) != 0 &&
      !allWithin(command.joint_stiffness, 0, 7, 0.0, p.joint_stiffness_max)) {
    return "cmd.jntStiffness out of range";
  }
  if ((flags & fri::kJointDamping) != 0 && !allWithin(command.joint_damping, 0, 7, 0.0, 1.0)) {
    return "cmd.jntDamping out of range";
  }
  if ((flags & fri::kCartesianStiffness) != 0 &&
      !(allWithin(command.cartesian_stiffness, 0, 3, 0.0, p.frame_stiffness_max) &&
        allWithin(command.cartesian_stiffness, 3, 6, 0.0, p.rotation_stiffness_max))) {
    return "cmd.cartStiffness out of range";
  }
  if ((flags & fri::kCartesianDamping) != 0 &&
      !allWithin(command.cartesian_damping, 0, 6, 0.0, 1.0)) {
    return "cmd.cartDamping out of range";
  }
  return {};
}

}  // namespace

bool poseFromWire(const float (&wire)[fri::kFrameValues], double tolerance, Pose& pose) {
  Matrix3d rotation;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rotation(row, column) = wire[4 * row + column];
    pose.position[row] = wire[4 * row + 3];
  }
  if (!rotation.allFinite() || !pose.position.allFinite()) return false;
  if ((rotation * rotation.transpose() - Matrix3d::Identity()).cwiseAbs().maxCoeff() > tolerance)
    return false;
  if (rotation.determinant() < 0.0) return false;
  pose.rotation = Quaterniond(rotation).normalized();
  return true;
}

void poseToWire(const Pose& pose, float (&wire)[fri::kFrameValues]) {
  const Matrix3d rotation = pose.rotation.toRotationMatrix();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      wire[4 * row + column] = static_cast<float>(rotation(row, column));
    wire[4 * row + 3] = static_cast<float>(pose.position[row]);
  }
}

int jointPastLimitSwitch(const Parameters& parameters, const Vector7& set_point) {
  for (int i = 0; i < 7; ++i) {
    if (std::abs(set_point[i]) > parameters.position_limit[i]) return i;
  }
  return -1;
}

std::string limitSwitchMessage(int joint) {
  return std::string("software limit switch ") + kJointNames[joint];
}

std::string checkEntry(const CheckContext& context, const fri::CommandDatagram& command) {
  const Parameters& p = context.parameters;
  const bool cartesian = context.strategy == fri::ControlStrategy::CartesianImpedance;
  const std::uint32_t needed = cartesian ? fri::kCartesianPosition : fri::kJointPosition;
  const std::uint32_t allowed =
      fri::flagsFor(context.strategy) | (cartesian ? fri::kJointPosition : 0U);
  if ((command.flags & needed) == 0 || (command.flags & ~allowed) != 0) {
    return "cmdFlags do not fit the control strategy";
  }
  if (std::string fault = checkValues(context, command); !fault.empty()) return fault;
  if ((command.flags & fri::kJointPosition) != 0) {
    for (int i = 0; i < 7; ++i) {
      if (std::abs(command.joint_position[i] - context.set_point[i]) > p.entry_position_tolerance) {
        return std::string("FRI interpolation error ") + kJointNames[i];
      }
    }
  }
  if (cartesian) {
    Pose frame;
    poseFromWire(command.cartesian_frame, p.frame_orthonormality, frame);
    if ((frame.position - context.frame_set_point.position).norm() > p.entry_frame_tolerance ||
        rotationBetween(context.frame_set_point.rotation, frame.rotation).norm() >
            p.entry_frame_tolerance) {
      return "cmd.cartPos not properly initialized";
    }
  }
  return {};
}

std::string checkCyclic(const CheckContext& context, const fri::CommandDatagram& command) {
  const Parameters& p = context.parameters;
  if (command.flags != context.latched_flags) return "cmdFlags changed during cmd mode";
  if (std::string fault = checkValues(context, command); !fault.empty()) return fault;
  if ((command.flags & fri::kJointPosition) != 0) {
    for (int i = 0; i < 7; ++i) {
      const double step = std::abs(command.joint_position[i] - context.set_point[i]);
      if (step > context.speed_limit[i] * p.period * (1.0 + p.speed_margin) + 1e-6) {
        return "FRI speed limit J" + std::to_string(i + 1) + " (" + kJointNames[i] + ")";
      }
    }
    const int joint = jointPastLimitSwitch(p, fri::jointsFromWire(command.joint_position));
    if (joint >= 0) return limitSwitchMessage(joint);
  }
  if ((command.flags & fri::kCartesianPosition) != 0) {
    Pose frame;
    poseFromWire(command.cartesian_frame, p.frame_orthonormality, frame);
    const double turn = rotationBetween(context.frame_set_point.rotation, frame.rotation).norm();
    if ((frame.position - context.frame_set_point.position).norm() >
            p.frame_speed_limit * p.period ||
        turn > p.frame_turn_limit * p.period) {
      return "FRI speed limit TCP";
    }
  }
  return {};
}

}  // namespace coglab_sim::krc
