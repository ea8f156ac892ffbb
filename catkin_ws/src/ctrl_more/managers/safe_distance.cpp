#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

#include <Eigen/Core>

#include "ctrl_more/central_module.hpp"

namespace ctrl_more {

/// Slows the robot down while a person is near, until it stands: speed and separation monitoring of
/// ISO/TS 15066:2016, 5.5.4. It is no safety function: neither the tracker nor this program is
/// rated.
///
/// The robot may move while the distance d to the person is at least the protective separation
/// distance (formula 1 there)
///
///     S_p = S_h + S_r + S_s + C + Z_d + Z_r
///
/// with S_h = v_h (T_r + T_s): way of the person until the robot stands; S_r = v_r T_r: way of the
/// robot in its reaction time; S_s = v_r^2 / (2 a): way while it brakes, T_s = v_r / a; C:
/// intrusion distance; Z_d, Z_r: uncertainty of the person's and of the robot's position. Solved
/// for v_r, the largest speed at distance d is
///
///     v_r = a (-b + sqrt(b^2 + 2 (d - v_h T_r - C - Z_d - Z_r) / a)),  b = T_r + v_h / a
///
/// and 0 where the root has no positive value. It becomes `otherReference/speed_limit` [m/s], which
/// the robot keeps for hand and elbow in every direction.
///
/// Block in the central module's file, all optional: `person` (key in estimatedData or
/// measuredData: position in the base frame, 3 numbers [m], or a pose, 7; `person`), `robot` (pose
/// of the hand in estimatedData; `ee`), `person_speed` (v_h, 1.6 m/s), `reaction_time` (T_r, 0.1
/// s), `deceleration` (a, 2 m/s^2), `intrusion` (C, 0.12 m), `person_uncertainty` (Z_d, 0.05 m),
/// `robot_uncertainty` (Z_r, 0.01 m), `max_age` of the person's position (0.2 s), `absent_speed`
/// (limit while it is missing or too old, 0 m/s).
class SafeDistance : public Manager {
 public:
  SafeDistance(const std::string& name, const ConfigNode& block, RobotStates& robot,
               ControlStates& control, Logger* logger);
  const std::string& name() const override { return name_; }
  void beginCycle(const Cycle& cycle) noexcept override { now_ns_ = cycle.now_ns; }
  void updateStage(Stage stage, const RobotStates& robot, ControlStates& control) noexcept override;

 private:
  double largestSpeed(double distance) const;

  std::string name_;
  double person_speed_, reaction_time_, deceleration_, kept_, absent_speed_;
  std::int64_t max_age_ns_;
  RobotSignal person_, hand_;
  ControlSignal limit_;
  LogSource log_;
  bool standing_ = false;
  std::int64_t now_ns_ = 0;
};

namespace {

double number(const ConfigNode& block, const char* key, double otherwise, double least,
              double most) {
  const ConfigNode* node = block.find(key);
  const double value = node ? node->number(key) : otherwise;
  if (value >= least && value <= most) return value;
  throw node->error(std::string(key) + " expects " + std::to_string(least) + " to " +
                    std::to_string(most) + ", got " + std::to_string(value));
}

std::string text(const ConfigNode& block, const char* key, const char* otherwise) {
  const ConfigNode* node = block.find(key);
  return node ? node->text(key) : otherwise;
}

}  // namespace

SafeDistance::SafeDistance(const std::string& name, const ConfigNode& block, RobotStates& robot,
                           ControlStates& control, Logger* logger)
    : name_(name), log_(logger, name) {
  block.requireKeys(
      "manager '" + name + "'",
      {"type", "libPath", "person", "robot", "person_speed", "reaction_time", "deceleration",
       "intrusion", "person_uncertainty", "robot_uncertainty", "max_age", "absent_speed"});
  person_speed_ = number(block, "person_speed", 1.6, 0.0, 10.0);
  reaction_time_ = number(block, "reaction_time", 0.1, 0.0, 5.0);
  deceleration_ = number(block, "deceleration", 2.0, 0.01, 100.0);
  kept_ = number(block, "intrusion", 0.12, 0.0, 5.0) +
          number(block, "person_uncertainty", 0.05, 0.0, 5.0) +
          number(block, "robot_uncertainty", 0.01, 0.0, 5.0) + person_speed_ * reaction_time_;
  max_age_ns_ = static_cast<std::int64_t>(1e9 * number(block, "max_age", 0.2, 0.001, 60.0));
  absent_speed_ = number(block, "absent_speed", 0.0, 0.0, 10.0);
  const std::string person = text(block, "person", "person");
  person_ = robot.find(RobotSource::Estimated, person);
  if (!person_.valid()) person_ = robot.find(RobotSource::Measured, person);
  if (person_.size() != 3 && person_.size() != 7) {
    throw block.error("it needs a robot signal '" + person +
                      "' with the person's position (3 numbers) or pose (7); a file of signals "
                      "brings it from a topic");
  }
  const std::string hand = text(block, "robot", "ee");
  hand_ = robot.find(RobotSource::Estimated, hand);
  if (hand_.size() < 3) {
    throw block.error("there is no pose estimatedData/" + hand + " of the robot's hand");
  }
  const Status declared =
      control.declare(ControlContainer::OtherReference, "speed_limit", 1, "m/s", "hand and elbow");
  if (!declared) throw std::runtime_error(declared.message());
  limit_ = control.find(ControlContainer::OtherReference, "speed_limit");
}

double SafeDistance::largestSpeed(double distance) const {
  const double free = distance - kept_;
  if (free <= 0.0) return 0.0;
  const double b = reaction_time_ + person_speed_ / deceleration_;
  return deceleration_ * (std::sqrt(b * b + 2.0 * free / deceleration_) - b);
}

void SafeDistance::updateStage(Stage stage, const RobotStates& robot,
                               ControlStates& control) noexcept {
  if (stage != Stage::Task) return;
  double speed = absent_speed_;
  const bool seen = robot.isFresh(person_, now_ns_, max_age_ns_);
  if (seen && robot.stamp(hand_) != kNeverWritten) {
    const Eigen::Vector3d person = robot.view(person_).head<3>();
    const Eigen::Vector3d hand = robot.view(hand_).head<3>();
    speed = largestSpeed((person - hand).norm());
  }
  const bool stands = speed <= 0.0;
  if (stands && !standing_) {
    CTRL_MORE_LOG(log_, Warning,
                  seen ? "a person is too near: the robot stands"
                       : "the person's position is missing: the robot stands");
  }
  standing_ = stands;
  double& limit = control.view(limit_)[0];
  limit = std::min(limit, speed);
}

}  // namespace ctrl_more

CTRL_MORE_REGISTER_MANAGER(ctrl_more::SafeDistance, "SafeDistance")
