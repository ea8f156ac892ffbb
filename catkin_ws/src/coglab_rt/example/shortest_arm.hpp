/// @file
/// The shortest back end: an arm that follows its commanded velocities exactly. No limits, no ROS.
#pragma once

#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>
#include <utility>

#include "coglab_rt/arm_port.hpp"
#include "coglab_rt/clock.hpp"

class ShortestArm : public coglab_rt::ArmPort {
 public:
  ~ShortestArm() override { shutdown(); }

  coglab_rt::ArmMailboxes& mailboxes() override { return mailboxes_; }

  void start(Wake wake) override {
    thread_ = std::thread([this, wake = std::move(wake)] {
      while (!ending_) {
        measure();
        wake(true);
        std::this_thread::sleep_for(std::chrono::duration<double>(kPeriod));
      }
    });
  }

  void setControllerActive(bool) override {}

  void shutdown() override {
    ending_ = true;
    if (thread_.joinable()) thread_.join();
  }

 private:
  static constexpr double kPeriod = 0.005;  // s
  static constexpr double kTimeout = 0.05;  // s, age at which a command ends

  void measure() {
    sample_.stamp_ns = coglab_rt::steadyNow();
    sample_.cycle_time = kPeriod;
    sample_.controller_ns += static_cast<std::int64_t>(1e9 * kPeriod);
    ++sample_.sequence;
    coglab_rt::VelocityCommand command;
    mailboxes_.takeVelocity(command);  // the newest, whether it is new or not
    const double age = 1e-9 * static_cast<double>(sample_.stamp_ns - command.stamp_ns);
    const bool counts = command.motion_epoch == sample_.motion_epoch && std::abs(age) < kTimeout;
    sample_.velocity.setZero();
    if (counts && command.velocity.allFinite()) sample_.velocity = command.velocity;
    sample_.position += kPeriod * sample_.velocity;
    sample_.commanded_position = sample_.position;
    sample_.commanded_velocity = sample_.velocity;
    sample_.block = coglab_rt::MotionBlock::None;  // it may always move
    mailboxes_.publishSample(sample_);
  }

  coglab_rt::ArmMailboxes mailboxes_;
  coglab_rt::RobotSample sample_;
  std::thread thread_;
  std::atomic<bool> ending_{false};
};
