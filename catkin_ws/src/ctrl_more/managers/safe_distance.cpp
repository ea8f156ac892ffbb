#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "ctrl_more/central_module.hpp"

namespace ctrl_more {

/// Slows the robot while a person is near, down to standstill: speed and separation monitoring of
/// ISO/TS 15066:2016, 5.5.4. It is not a safety function: neither the tracker nor this program is
/// safety-rated.
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
/// the robot keeps for hand and elbow in every direction. d is the shortest distance from any point
/// of the person to the lines between the points of the arm. The lowest limit counts.
///
/// A handover ends in touch, which separation would never allow. For the points of the person in
/// `touch` the limit does not fall below `touch_speed` where the last line of the arm, wrist to
/// palm, is the nearest one: power and force limiting there (5.5.5), separation everywhere else.
/// A free touch has the force v sqrt(mu k), mu = 1 / (1/m_person + 1/m_robot), v: speed of arm and
/// person against each other. docs/equations.md has the source of each figure.
///
/// Parameters of its block in the central module's file, all optional, with their defaults:
///
/// - `person: person`: key or list of keys in estimatedData or measuredData; each is a position in
///   the base frame (3 numbers, m) or a pose (7)
/// - `touch: []`: those of `person` that may touch the palm
/// - `touch_speed: 0.25` m/s: least limit where such a point is nearest to the palm's line
/// - `robot: arm_points`, else `ee`: points of the arm in estimatedData (3 numbers each, m) or a
///   pose (7)
/// - `robot_radius: 0` m: radius of the arm about the lines between these points
/// - `person_speed: 1.6` m/s: v_h
/// - `reaction_time: 0.1` s: T_r
/// - `deceleration: 2` m/s^2: a
/// - `intrusion: 0.12` m: C
/// - `person_uncertainty: 0.05` m: Z_d
/// - `robot_uncertainty: 0.01` m: Z_r
/// - `max_age: 0.2` s: an older position of the person does not count
/// - `absent_speed: 0` m/s: limit while all points of the person are missing or too old
class SafeDistance : public Manager {
 public:
  SafeDistance(const std::string& name, const ConfigNode& block, RobotStates& robot,
               ControlStates& control, Logger* logger);
  const std::string& name() const override { return name_; }
  void beginCycle(const Cycle& cycle) noexcept override { now_ns_ = cycle.now_ns; }
  void updateStage(Stage stage, const RobotStates& robot, ControlStates& control) noexcept override;

 private:
  /// A tracked point of the person.
  struct Point {
    RobotSignal position;
    bool may_touch;
  };

  double largestSpeed(double distance) const noexcept;
  double speedFor(const Eigen::Vector3d& person, bool may_touch,
                  const RobotStates& robot) const noexcept;

  std::string name_;
  double person_speed_, reaction_time_, deceleration_, kept_, absent_speed_, touch_speed_;
  std::int64_t max_age_ns_;
  std::vector<Point> person_;
  RobotSignal arm_;
  int arm_points_ = 1;
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

/// A text or a list of texts.
std::vector<std::string> texts(const ConfigNode& block, const char* key,
                               std::vector<std::string> otherwise) {
  const ConfigNode* node = block.find(key);
  if (node == nullptr) return otherwise;
  if (node->kind() == ConfigNode::Kind::Scalar) return {node->text(key)};
  return node->texts(key);
}

RobotSignal findPerson(const RobotStates& robot, const std::string& key, const ConfigNode& block) {
  RobotSignal found = robot.find(RobotSource::Estimated, key);
  if (!found.valid()) found = robot.find(RobotSource::Measured, key);
  if (found.size() == 3 || found.size() == 7) return found;
  throw block.error("it needs a robot signal '" + key +
                    "' with a position of the person (3 numbers) or a pose (7); a file of signals "
                    "brings it from a topic");
}

/// Distance of a point to the line from `a` to `b`.
double distanceToLine(const Eigen::Vector3d& point, const Eigen::Vector3d& a,
                      const Eigen::Vector3d& b) noexcept {
  const Eigen::Vector3d way = b - a;
  const double length = way.squaredNorm();
  const double share = length > 0.0 ? std::clamp((point - a).dot(way) / length, 0.0, 1.0) : 0.0;
  return (point - a - share * way).norm();
}

}  // namespace

SafeDistance::SafeDistance(const std::string& name, const ConfigNode& block, RobotStates& robot,
                           ControlStates& control, Logger* logger)
    : name_(name), log_(logger, name) {
  block.requireKeys("manager '" + name + "'",
                    {"type", "libPath", "person", "touch", "touch_speed", "robot", "robot_radius",
                     "person_speed", "reaction_time", "deceleration", "intrusion",
                     "person_uncertainty", "robot_uncertainty", "max_age", "absent_speed"});
  person_speed_ = number(block, "person_speed", 1.6, 0.0, 10.0);
  reaction_time_ = number(block, "reaction_time", 0.1, 0.0, 5.0);
  deceleration_ = number(block, "deceleration", 2.0, 0.01, 100.0);
  kept_ = number(block, "intrusion", 0.12, 0.0, 5.0) +
          number(block, "person_uncertainty", 0.05, 0.0, 5.0) +
          number(block, "robot_uncertainty", 0.01, 0.0, 5.0) +
          number(block, "robot_radius", 0.0, 0.0, 1.0) + person_speed_ * reaction_time_;
  max_age_ns_ = static_cast<std::int64_t>(1e9 * number(block, "max_age", 0.2, 0.001, 60.0));
  absent_speed_ = number(block, "absent_speed", 0.0, 0.0, 10.0);
  touch_speed_ = number(block, "touch_speed", 0.25, 0.0, 10.0);
  const std::vector<std::string> touch = texts(block, "touch", {});
  const std::vector<std::string> person = texts(block, "person", {"person"});
  if (person.empty()) throw block.error("person expects a key or a list of keys, got none");
  for (const std::string& key : person) {
    const bool may_touch = std::find(touch.begin(), touch.end(), key) != touch.end();
    person_.push_back({findPerson(robot, key, block), may_touch});
  }
  for (const std::string& key : touch) {
    if (std::find(person.begin(), person.end(), key) != person.end()) continue;
    throw block.error("touch has '" + key + "', which is not in person");
  }
  const bool has_points = robot.find(RobotSource::Estimated, "arm_points").valid();
  const std::string arm = texts(block, "robot", {has_points ? "arm_points" : "ee"}).at(0);
  arm_ = robot.find(RobotSource::Estimated, arm);
  if (arm_.size() != 7 && (arm_.size() < 3 || arm_.size() % 3 != 0)) {
    throw block.error(
        "there are no points (3 numbers each) and no pose (7) of the robot in "
        "estimatedData/" +
        arm);
  }
  arm_points_ = arm_.size() == 7 ? 1 : arm_.size() / 3;
  const Status declared =
      control.declare(ControlContainer::OtherReference, "speed_limit", 1, "m/s", "hand and elbow");
  if (!declared) throw std::runtime_error(declared.message());
  limit_ = control.find(ControlContainer::OtherReference, "speed_limit");
}

double SafeDistance::largestSpeed(double distance) const noexcept {
  const double free = distance - kept_;
  if (free <= 0.0) return 0.0;
  const double b = reaction_time_ + person_speed_ / deceleration_;
  return deceleration_ * (std::sqrt(b * b + 2.0 * free / deceleration_) - b);
}

double SafeDistance::speedFor(const Eigen::Vector3d& person, bool may_touch,
                              const RobotStates& robot) const noexcept {
  const auto arm = robot.view(arm_);
  const auto point = [&arm](int index) { return Eigen::Vector3d(arm.segment<3>(3 * index)); };
  const int last = std::max(1, arm_points_ - 1);  // line, counted from 1
  double nearest = std::numeric_limits<double>::infinity(), hand = nearest;
  for (int line = 1; line <= last; ++line) {
    hand = distanceToLine(person, point(line - 1), point(std::min(line, arm_points_ - 1)));
    nearest = std::min(nearest, hand);
  }
  const double speed = largestSpeed(nearest);
  return may_touch && hand <= nearest ? std::max(speed, touch_speed_) : speed;
}

void SafeDistance::updateStage(Stage stage, const RobotStates& robot,
                               ControlStates& control) noexcept {
  if (stage != Stage::Task) return;
  double speed = std::numeric_limits<double>::infinity();
  bool seen = false;
  for (const Point& point : person_) {
    if (!robot.isFresh(point.position, now_ns_, max_age_ns_)) continue;
    if (robot.stamp(arm_) == kNeverWritten) continue;
    seen = true;
    const Eigen::Vector3d person = robot.view(point.position).head<3>();
    speed = std::min(speed, speedFor(person, point.may_touch, robot));
  }
  if (!seen) speed = absent_speed_;
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
