#include "lwr_fri_bridge/motion/tool_frame.hpp"

namespace lwr_fri_bridge {

Eigen::Isometry3d flangePose(const Vector7& joints) {
  // Denavit-Hartenberg: d along z and the twist alpha after each joint, as multiples of 90 degrees.
  static constexpr double kOffset[7] = {0.3105, 0.0, 0.4, 0.0, 0.39, 0.0, 0.078};
  static constexpr double kTwist[7] = {1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 0.0};
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  for (int i = 0; i < 7; ++i) {
    position += kOffset[i] * rotation.col(2);
    const double c = std::cos(joints[i]), s = std::sin(joints[i]);
    const Eigen::Vector3d x = c * rotation.col(0) + s * rotation.col(1);
    const Eigen::Vector3d y = c * rotation.col(1) - s * rotation.col(0);
    const Eigen::Vector3d z = rotation.col(2);
    rotation.col(0) = x;
    // A twist of +-90 degrees about x turns y into +-z and z into -+y.
    rotation.col(1) = kTwist[i] == 0.0 ? y : Eigen::Vector3d(kTwist[i] * z);
    rotation.col(2) = kTwist[i] == 0.0 ? z : Eigen::Vector3d(-kTwist[i] * y);
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = rotation;
  pose.translation() = position;
  return pose;
}

void CartesianSetPoint::anchor(const Vector7& joints, const float (&frame)[fri::kFrameValues]) {
  Eigen::Isometry3d reported = Eigen::Isometry3d::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) reported(row, column) = frame[4 * row + column];
  }
  relative_ = flangePose(joints).inverse() * reported;
}

void CartesianSetPoint::frame(const Vector7& joints, float (&frame)[fri::kFrameValues]) const {
  const Eigen::Isometry3d wanted = flangePose(joints) * relative_;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      frame[4 * row + column] = static_cast<float>(wanted(row, column));
  }
}

Vector6 toolWrench(const fri::MeasurementDatagram& measurement, bool in_tool_axes) {
  constexpr double kOrthonormal = 1e-3;  // float32 frames have an error of 1e-6
  Vector6 wrench = fri::wrenchFromWire(measurement.external_wrench);
  if (in_tool_axes) return wrench;
  Eigen::Matrix3d tool;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      tool(row, column) = static_cast<double>(measurement.measured_frame[4 * row + column]);
  }
  const Eigen::Matrix3d deviation = tool * tool.transpose() - Eigen::Matrix3d::Identity();
  const bool rotation = (deviation.array().abs() < kOrthonormal).all();  // false for NaN
  if (!rotation) tool = flangePose(fri::jointsFromWire(measurement.measured_position)).linear();
  wrench.head<3>() = (tool.transpose() * wrench.head<3>()).eval();
  wrench.tail<3>() = (tool.transpose() * wrench.tail<3>()).eval();
  return wrench;
}

}  // namespace lwr_fri_bridge
