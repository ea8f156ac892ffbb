/// Frames: the flange against a product of elementary turns, the Cartesian set-point, the wrench.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include <Eigen/Geometry>

#include "lwr_fri_bridge/motion/tool_frame.hpp"

namespace lwr_fri_bridge {
namespace {

using Frame = Eigen::Isometry3d;

/// The LWR 4+ as its description has it: lengths along z, axes turned about x by 90 degrees.
Frame flange(const Vector7& joints) {
  const double length[7] = {0.3105, 0.0, 0.4, 0.0, 0.39, 0.0, 0.078};
  const double twist[7] = {90, -90, -90, 90, 90, -90, 0};
  Frame pose = Frame::Identity();
  for (int i = 0; i < 7; ++i) {
    pose = pose * Eigen::Translation3d(0.0, 0.0, length[i]) *
           Eigen::AngleAxisd(joints[i], Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(twist[i] * M_PI / 180.0, Eigen::Vector3d::UnitX());
  }
  return pose;
}

Vector7 posture(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> angle(-2.0, 2.0);
  Vector7 joints;
  for (int i = 0; i < 7; ++i) joints[i] = angle(random);
  return joints;
}

void toWire(const Frame& pose, float (&frame)[fri::kFrameValues]) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      frame[4 * row + column] = static_cast<float>(pose(row, column));
  }
}

void expectFrame(const float (&frame)[fri::kFrameValues], const Frame& expected) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      EXPECT_NEAR(frame[4 * row + column], expected(row, column), 1e-6) << row << column;
  }
}

TEST(ToolFrame, TheFlangeIsWhereTheJointsCarryIt) {
  EXPECT_TRUE(flangePose(Vector7::Zero()).translation().isApprox(Eigen::Vector3d(0, 0, 1.1785)));
  for (unsigned seed = 0; seed < 50; ++seed) {
    const Vector7 joints = posture(seed);
    EXPECT_TRUE(flangePose(joints).matrix().isApprox(flange(joints).matrix(), 1e-12)) << seed;
  }
}

/// Joint motion moves the reported frame of the controller, with any tool.
TEST(ToolFrame, TheCartesianSetPointCarriesTheReportedFrameAlong) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    const Vector7 from = posture(seed), to = posture(seed + 100);
    const Frame tool = Eigen::Translation3d(0.02, -0.05, 0.1) *
                       Frame(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, -2.0, 0.5).normalized()));
    float reported[fri::kFrameValues], commanded[fri::kFrameValues];
    toWire(flange(from) * tool, reported);
    CartesianSetPoint set_point;
    set_point.anchor(from, reported);
    set_point.frame(from, commanded);
    expectFrame(commanded, flange(from) * tool);
    set_point.frame(to, commanded);
    expectFrame(commanded, flange(to) * tool);
  }
}

TEST(ToolFrame, TheControllersFrameIsItsCommandMovedByTheOffset) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    const Frame command = flange(posture(seed)), offset = flange(posture(seed + 50));
    fri::MeasurementDatagram m{};
    toWire(command, m.commanded_frame);
    toWire(offset, m.commanded_frame_offset);
    float frame[fri::kFrameValues];
    fri::cartesianSetPointOf(m, frame);
    expectFrame(frame, command * offset);
    // An offset that is not filled is none, whatever else the datagram holds.
    for (float& value : m.commanded_frame_offset) value = 0.0F;
    m.commanded_frame_offset[3] = 0.3F;
    m.commanded_frame_offset[11] = 0.3F;
    for (float& torque : m.measured_torque) torque = 5.0F;
    fri::cartesianSetPointOf(m, frame);
    expectFrame(frame, command);
  }
}

/// A measured frame that is no rotation within 1e-3 is not filled: the flange counts.
TEST(ToolFrame, TheWrenchTurnsByTheMeasuredFrameIfItIsOne) {
  const Vector7 joints = posture(3);
  const Frame tool = flange(posture(4));
  Vector6 wrench;
  wrench << 3.0, -5.0, 7.0, 0.2, 0.4, -0.6;
  fri::MeasurementDatagram m{};
  fri::jointsToWire(joints, m.measured_position);
  fri::wrenchToWire(wrench, m.external_wrench);
  EXPECT_EQ(m.external_wrench[3], -0.6F);
  EXPECT_EQ(m.external_wrench[5], 0.2F);
  const auto turnedBy = [&](const Frame& frame) {
    Vector6 turned;
    turned << frame.linear().transpose() * wrench.head<3>(),
        frame.linear().transpose() * wrench.tail<3>();
    return turned;
  };
  toWire(tool, m.measured_frame);
  EXPECT_TRUE(toolWrench(m, false).isApprox(turnedBy(tool), 1e-6));
  EXPECT_TRUE(toolWrench(m, true).isApprox(wrench, 1e-6));
  for (const double scale : {1.0004, 0.9996, 1.0007, 0.9993}) {
    Frame scaled = tool;
    scaled.linear() *= scale;  // 8e-4 and 1.4e-3 off in the products
    toWire(scaled, m.measured_frame);
    const bool rotation = std::abs(scale - 1.0) < 5e-4;
    EXPECT_TRUE(toolWrench(m, false).isApprox(turnedBy(rotation ? scaled : flange(joints)), 1e-5))
        << scale;
  }
  for (const int entry : {0, 5, 10}) {
    toWire(tool, m.measured_frame);
    m.measured_frame[entry] = NAN;
    EXPECT_TRUE(toolWrench(m, false).isApprox(turnedBy(flange(joints)), 1e-6)) << entry;
  }
}

}  // namespace
}  // namespace lwr_fri_bridge
