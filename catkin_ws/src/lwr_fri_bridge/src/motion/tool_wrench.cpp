#include "lwr_fri_bridge/motion/tool_wrench.hpp"

#include "lwr_fri_bridge/motion/cartesian_set_point.hpp"

namespace lwr_fri_bridge {
namespace {

constexpr double kOrthonormal = 1e-3;  // float32 frames are good to 1e-6

}  // namespace

Vector6 toolWrench(const fri::MeasurementDatagram& measurement, bool in_tool_axes) {
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
