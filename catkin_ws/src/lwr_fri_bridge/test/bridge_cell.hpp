/// @file
/// Bridge and small controller in lockstep, for the tests of the bridge.
#pragma once

#include <gtest/gtest.h>

#include "small_controller.hpp"

namespace lwr_fri_bridge::test {

struct Cell {
  explicit Cell(double period = 0.005, const BridgeConfig& config = defaultConfig())
      : bridge(config), robot(period) {}
  void run(int cycles) {
    for (int i = 0; i < cycles; ++i) robot.cycle(bridge);
  }
  void runDriven(int cycles, const Vector7& velocity) {
    for (int i = 0; i < cycles; ++i) {
      drive(bridge, robot, velocity);
      robot.cycle(bridge);
    }
  }
  void start() {
    run(3);
    const Outcome outcome = runEvent(bridge, robot, "start");
    ASSERT_TRUE(outcome.success()) << describe(outcome);
    run(1);
  }
  Bridge bridge;
  SmallController robot;
};

inline void expectMirror(const Cell& cell, const Vector7& set_point) {
  for (int i = 0; i < 7; ++i)
    EXPECT_FLOAT_EQ(cell.robot.answer.joint_position[i], static_cast<float>(set_point[i]));
}

}  // namespace lwr_fri_bridge::test
