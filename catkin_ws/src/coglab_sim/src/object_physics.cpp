#include "coglab_sim/object_physics.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "coglab_sim/ranges.hpp"

namespace coglab_sim {
namespace {

constexpr double kGravity = 9.81;
constexpr double kShareTime = 0.02;  // s over which load shares are averaged
constexpr double kSafeGrip =
    1.5;  // friction over weight at which a hand that was given the object holds it
constexpr double kGripBegins = 0.05, kGripEnds = 0.02;

// Palm and straight fingers as points in ih2_palm, from the shapes in the URDF; a point is a ball
// of this radius.
constexpr double kSkin = 0.006;
const std::array<Vector3d, 9> kPalmPoints = {
    Vector3d(-kSkin, -0.035, -0.04), Vector3d(-kSkin, 0.0, -0.04), Vector3d(-kSkin, 0.035, -0.04),
    Vector3d(-kSkin, -0.035, 0.0),   Vector3d(-kSkin, 0.0, 0.0),   Vector3d(-kSkin, 0.035, 0.0),
    Vector3d(-kSkin, -0.035, 0.035), Vector3d(-kSkin, 0.0, 0.035), Vector3d(-kSkin, 0.035, 0.035)};
struct Finger {
  int motor;
  Vector3d base;
};
const std::array<Finger, 3> kFingers = {Finger{2, Vector3d(-0.0175, 0.030, 0.035)},
                                        Finger{3, Vector3d(-0.0175, 0.010, 0.035)},
                                        Finger{4, Vector3d(-0.0175, -0.020, 0.035)}};
constexpr std::array<double, 2> kAlongFinger = {0.045, 0.085};  // m from the base
constexpr double kFlexionRange = 1.5;                           // rad at position 254
constexpr double kWidestGrasp = 0.16;                           // m between open thumb and fingers

std::array<int, 5> fingerContacts(const ObjectParameters& object) {
  std::array<int, 5> contacts = object.finger_contact;
  const double width = std::min(object.size.x(), object.size.y());
  const int from_width = static_cast<int>(std::lround(254.0 * (1.0 - width / kWidestGrasp)));
  for (int& contact : contacts) {
    if (contact < 0) contact = from_width;
    contact = std::clamp(contact, 20, 230);
  }
  contacts[0] = 255;  // the thumb's abduction meets nothing
  return contacts;
}

const ObjectParameters& checked(const ObjectParameters& object) {
  requireWithin("object/mass", object.mass);
  requireWithin("object/friction", object.friction);
  return object;
}

}  // namespace

ObjectPhysics::ObjectPhysics(const ObjectParameters& object, const ContactParameters& contact)
    : object_(checked(object)),
      contact_(contact),
      shape_(object.shape, object.size),
      inertia_(object.mass * shape_.unitInertia()),
      finger_contact_(fingerContacts(object)),
      human_grip_(contact.human),
      robot_grip_(contact.robot) {
  place(Placement::HumanHand, Pose{});
}

void ObjectPhysics::place(Placement placement, const Pose& pose) {
  placement_ = placement;
  placed_ = pose;
  pinned_ = placement != Placement::World;
  folded_.fill(false);
  human_grip_.release();
  robot_grip_.release();
  speed_ = Twist{};
  dropped_ = on_board_ = on_floor_ = false;
  robot_share_ = human_share_ = 0.0;
  palm_force_.setZero();
  center_ = pose * Pose{object_.center, Quaterniond::Identity()};
}

Pose ObjectPhysics::pose() const {
  return center_ * Pose{-object_.center, Quaterniond::Identity()};
}

Twist ObjectPhysics::twist() const {
  return {speed_.at(center_.rotation * -object_.center), speed_.angular};
}

std::string ObjectPhysics::heldBy() const {
  const bool robot = robot_grip_.engaged(),
             human = human_grip_.engaged() || (pinned_ && placement_ == Placement::HumanHand);
  if (robot && human) return "both";
  if (robot || (pinned_ && placement_ == Placement::RobotHand)) return "robot";
  if (human) return "human";
  if (on_board_) return "board";
  return on_floor_ ? "floor" : "none";
}

bool ObjectPhysics::inGrasp(const Pose& palm) const {
  Vector3d normal;
  return shape_.distance(center_.inverse() * (palm * contact_.grasp_center), normal) <
         contact_.robot_reach;
}

FingerContactState ObjectPhysics::fingerContact(const Pose& palm) const {
  FingerContactState state{{255, 255, 255, 255, 255}, {0.0, 0.0, 0.0, 0.0, 0.0}};
  if (!robot_grip_.engaged() && !inGrasp(palm)) return state;
  for (std::size_t i = 1; i < 5; ++i) {
    if (folded_[i]) continue;
    state.position[i] = finger_contact_[i];
    state.stiffness[i] = contact_.current_per_count;
  }
  return state;
}

void ObjectPhysics::watchFingers(const Pose& palm, const FingerInput& fingers) {
  const bool there =
      pinned_ ? placement_ == Placement::RobotHand : robot_grip_.engaged() || inGrasp(palm);
  for (std::size_t i = 0; i < folded_.size(); ++i) {
    const bool closed = fingers[i] >= finger_contact_[i];
    folded_[i] = closed && (folded_[i] || !there);
  }
}

double ObjectPhysics::fingerForce(const FingerInput& fingers) const {
  // Fingers press against the thumb and against the palm, the thumb against the fingers only.
  const auto force = [&](std::size_t motor) {
    if (folded_[motor]) return 0.0;
    const double counts = std::max(0, fingers[motor] - finger_contact_[motor]);
    return std::min(contact_.finger_force_max, contact_.newton_per_count * counts);
  };
  const double thumb = force(1), others = force(2) + force(3) + force(4);
  return 2.0 * std::min(std::max(thumb, 0.5 * others), others);
}

Vector3d ObjectPhysics::touch(const Vector3d& point, const Vector3d& normal, double depth,
                              const Vector3d& other_speed, int points, Wrench& wrench) const {
  const Vector3d arm = point - center_.position;
  const Vector3d approach = speed_.at(arm) - other_speed;
  const double rate = -approach.dot(normal);  // > 0: sinking in
  const double normal_force = std::max(
      0.0, contact_.stiffness * std::pow(depth, 1.5) * (1.0 + contact_.restitution_damping * rate));
  const Vector3d slide = approach + rate * normal;
  const double slide_speed = std::max(slide.norm(), contact_.slip_speed);
  // The explicit step must not reverse a slide within one step.
  const double stiffest = 0.5 * object_.mass / (1e-3 * points);
  const double resistance = std::min(object_.friction * normal_force / slide_speed, stiffest);
  const Vector3d force = normal_force * normal - resistance * slide;
  wrench.add(force, arm);
  return force;
}

Wrench ObjectPhysics::planes() {
  Wrench wrench;
  on_floor_ = on_board_ = false;
  const bool sphere = shape_.kind() == Shape::Kind::Sphere;
  const int points = static_cast<int>(shape_.supports().size());
  const Vector3d half_board = 0.5 * contact_.board_size;
  for (const Vector3d& support : shape_.supports()) {
    Vector3d point = center_ * support;
    if (sphere) point.z() -= shape_.radius();
    const double below_floor = contact_.floor_height - point.z();
    if (below_floor > 0.0) {
      touch(point, Vector3d::UnitZ(), below_floor, Vector3d::Zero(), points, wrench);
      on_floor_ = true;
    }
    const double below_board = contact_.board_center.z() - point.z();
    const bool over_board = std::abs(point.x() - contact_.board_center.x()) < half_board.x() &&
                            std::abs(point.y() - contact_.board_center.y()) < half_board.y();
    if (over_board && below_board > 0.0 && below_board < 0.03) {
      touch(point, Vector3d::UnitZ(), below_board, Vector3d::Zero(), points, wrench);
      on_board_ = true;
    }
  }
  dropped_ = dropped_ || on_floor_;
  return wrench;
}

Wrench ObjectPhysics::palmTouch(const Pose& palm, const Twist& palm_twist,
                                const FingerInput& fingers, Wrench& reaction) const {
  Wrench wrench;
  const Pose to_object = center_.inverse() * palm;
  const auto at = [&](const Vector3d& in_palm) {
    Vector3d normal;
    const double depth = kSkin - shape_.distance(to_object * in_palm, normal);
    if (depth <= 0.0) return;
    const Vector3d point = palm * in_palm;
    const Vector3d arm = point - palm.position;
    // The surface's outward normal points at the palm; the object is pushed the other way.
    const Vector3d force =
        touch(point, -(center_.rotation * normal), depth, palm_twist.at(arm), 9, wrench);
    reaction.add(-force, arm);
  };
  for (const Vector3d& point : kPalmPoints) at(point);
  for (const Finger& finger : kFingers) {
    const auto motor = static_cast<std::size_t>(finger.motor);
    if (fingers[motor] >= finger_contact_[motor]) continue;  // then it grasps or is folded away
    const double angle = kFlexionRange * fingers[motor] / 254.0;
    for (const double along : kAlongFinger) {
      at(finger.base + along * Vector3d(std::sin(angle), 0.0, std::cos(angle)));
    }
  }
  return wrench;
}

void ObjectPhysics::pin(const Pose& hand, const Twist& twist) {
  const Pose object = hand * placed_;
  center_ = object * Pose{object_.center, Quaterniond::Identity()};
  speed_ = {twist.at(center_.position - hand.position), twist.angular};
}

Wrench ObjectPhysics::step(const Pose& palm, const Twist& palm_twist, const HumanInput& human,
                           bool human_present, const FingerInput& fingers, double dt) {
  watchFingers(palm, fingers);
  if (pinned_) {
    // What is placed into a hand stays there until that hand really holds it.
    const bool in_robot = placement_ == Placement::RobotHand;
    if (!in_robot && !human_present) {
      robot_share_ = human_share_ = 0.0;
      return {};
    }
    pin(in_robot ? palm : human.hand, in_robot ? palm_twist : human.twist);
    const double normal_force =
        in_robot ? fingerForce(fingers) : 2.0 * human.grip * human.grip_force;
    pinned_ = object_.friction * normal_force < kSafeGrip * object_.mass * kGravity;
    if (pinned_) return {};
    if (in_robot) {
      robot_grip_.engage(palm, center_);
    } else {
      human_grip_.engage(human.hand, center_);
    }
  }

  // Who holds
  Vector3d normal;
  if (human_present && !human_grip_.engaged() && human.grip > kGripBegins &&
      shape_.distance(center_.inverse() * human.hand.position, normal) < contact_.human_reach) {
    human_grip_.engage(human.hand, center_);
  } else if (!human_present || human.grip < kGripEnds) {
    human_grip_.release();
  }
  const double finger_force = fingerForce(fingers);
  if (!robot_grip_.engaged() && finger_force > 0.0 && inGrasp(palm)) {
    robot_grip_.engage(palm, center_);
  } else if (finger_force <= 0.0) {
    robot_grip_.release();
  }

  const double smallest = inertia_.minCoeff();
  const Wrench by_human = human_grip_.evaluate(
      human.hand, human.twist, center_, speed_, std::clamp(human.grip, 0.0, 1.0),
      2.0 * object_.friction * human.grip * human.grip_force, object_.mass, smallest);
  const Wrench by_grasp = robot_grip_.evaluate(
      palm, palm_twist, center_, speed_, std::min(1.0, finger_force / contact_.full_grasp_force),
      object_.friction * finger_force, object_.mass, smallest);
  Wrench on_palm;
  const Wrench by_palm = palmTouch(palm, palm_twist, fingers, on_palm);
  const Wrench by_plane = planes();

  // What the grasp does to the object it does to the palm, the other way round.
  on_palm.force -= by_grasp.force;
  on_palm.torque -= by_grasp.torque + (center_.position - palm.position).cross(by_grasp.force);
  palm_force_ = on_palm.force;

  const double weight = object_.mass * kGravity;
  const double keep = std::exp(-dt / kShareTime);
  const auto share = [&](double old, double lift) {
    return keep * old + (1.0 - keep) * std::clamp(lift / weight, 0.0, 1.0);
  };
  robot_share_ = share(robot_share_, by_grasp.force.z() + by_palm.force.z());
  human_share_ = share(human_share_, by_human.force.z());

  // Semi-implicit Euler; the gyroscopic torque is in body axes.
  const Vector3d force = by_human.force + by_grasp.force + by_palm.force + by_plane.force;
  const Vector3d torque = by_human.torque + by_grasp.torque + by_palm.torque + by_plane.torque;
  speed_.linear += dt * (force / object_.mass - kGravity * Vector3d::UnitZ());
  const Quaterniond to_body = center_.rotation.conjugate();
  const Vector3d spin = to_body * speed_.angular;
  const Vector3d momentum = inertia_.cwiseProduct(spin);
  const Vector3d spin_rate = (to_body * torque - spin.cross(momentum)).cwiseQuotient(inertia_);
  speed_.angular += dt * (center_.rotation * spin_rate);
  center_.position += dt * speed_.linear;
  const Vector3d turn = dt * speed_.angular;
  const double angle = turn.norm();
  if (angle > 1e-12) {
    center_.rotation =
        (Quaterniond(Eigen::AngleAxisd(angle, turn / angle)) * center_.rotation).normalized();
  }
  return on_palm;
}

}  // namespace coglab_sim
