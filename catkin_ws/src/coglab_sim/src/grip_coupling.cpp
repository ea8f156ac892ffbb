#include "coglab_sim/grip_coupling.hpp"

#include <algorithm>
#include <cmath>

namespace coglab_sim {
namespace {
// Fastest oscillation that the explicit 1 ms step carries well, rad/s.
constexpr double kFastest = 250.0;
}  // namespace

void GripCoupling::engage(const Pose& hand, const Pose& object) {
  engaged_ = true;
  slipping_ = false;
  in_hand_ = hand.inverse() * object;
  grip_point_ = object.inverse() * hand.position;
}

Wrench GripCoupling::evaluate(const Pose& hand, const Twist& hand_twist, const Pose& object,
                              const Twist& object_twist, double closure, double friction,
                              double mass, double inertia) {
  Wrench wrench;
  if (!engaged_ || closure <= 0.0) return wrench;
  const double stiffness = closure * std::min(figures_.stiffness, mass * kFastest * kFastest);
  const double damping = 2.0 * figures_.damping_ratio * std::sqrt(stiffness * mass);
  const double turning =
      closure * std::min(figures_.rotation_stiffness, inertia * kFastest * kFastest);
  const double turning_damping = 2.0 * figures_.damping_ratio * std::sqrt(turning * inertia);

  const Vector3d arm = object.rotation * grip_point_;
  const Vector3d wanted_point = hand * (in_hand_ * grip_point_);
  const Vector3d stretch = wanted_point - (object.position + arm);
  const Vector3d hand_speed = hand_twist.at(wanted_point - hand.position);
  Vector3d force = stiffness * stretch + damping * (hand_speed - object_twist.at(arm));

  const Quaterniond wanted_rotation = hand.rotation * in_hand_.rotation;
  const Vector3d turn = rotationBetween(object.rotation, wanted_rotation);
  Vector3d torque = turning * turn + turning_damping * (hand_twist.angular - object_twist.angular);

  slipping_ = false;
  const double size = force.norm();
  if (size > friction) {
    slipping_ = true;
    force *= friction / size;
    // The anchor follows so far that the spring alone carries what friction can.
    const double spring = stiffness * stretch.norm();
    if (spring > friction && spring > 0.0) {
      const Vector3d excess = stretch * (1.0 - friction / spring);
      in_hand_.position -= hand.rotation.conjugate() * excess;
    }
  }
  const double torque_size = torque.norm(), torque_limit = friction * figures_.lever;
  if (torque_size > torque_limit) {
    slipping_ = true;
    torque *= torque_limit / torque_size;
    const double spring = turning * turn.norm();
    if (spring > torque_limit && spring > 0.0) {
      const Vector3d excess = turn * (1.0 - torque_limit / spring);
      const Eigen::AngleAxisd back(-excess.norm(), excess.normalized());
      in_hand_.rotation =
          (hand.rotation.conjugate() * (Quaterniond(back) * wanted_rotation)).normalized();
    }
  }
  wrench.add(force, arm);
  wrench.torque += torque;
  return wrench;
}

}  // namespace coglab_sim
