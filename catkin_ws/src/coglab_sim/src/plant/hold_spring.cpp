#include "coglab_sim/plant/hold_spring.hpp"

#include <algorithm>

namespace coglab_sim::plant {

Wrench HoldSpring::evaluate(const Pose& hand, const Twist& hand_twist, const FreeBody& body,
                            const HoldLimits& limits, double share) {
  Wrench wrench;
  if (!engaged_ || share <= 0.0) return wrench;
  const double w = limits.bandwidth;
  const Pose wanted = hand * in_hand_;
  const Vector3d speed = hand_twist.at(wanted.position - hand.position);
  const Vector3d stretch = wanted.position - body.center.position;
  const Vector3d weight(0.0, 0.0, carries_ahead_ ? body.mass * kGravity : 0.0);
  const Vector3d spring = body.mass * w * w * stretch + weight;
  Vector3d force = share * (spring + 2.0 * w * body.mass * (speed - body.twist.linear));
  if (const double size = force.norm(); size > limits.force) {
    force *= limits.force / size;
    // The target follows the body until the spring force equals the limit.
    const double carried = share * spring.norm();
    if (carried > limits.force)
      in_hand_.position -= hand.rotation.conjugate() * (stretch * (1.0 - limits.force / carried));
  }

  const Quaterniond to_body = body.center.rotation.conjugate();
  const Vector3d turn = to_body * rotationBetween(body.center.rotation, wanted.rotation);
  const Vector3d spin = to_body * (hand_twist.angular - body.twist.angular);
  const Vector3d twisting = w * w * body.inertia.cwiseProduct(turn);
  Vector3d torque = share * (twisting + 2.0 * w * body.inertia.cwiseProduct(spin));
  if (const double size = torque.norm(); size > limits.torque) {
    torque *= limits.torque / size;
    const double carried = share * twisting.norm();
    if (carried > limits.torque) {
      const Vector3d excess = body.center.rotation * (turn * (1.0 - limits.torque / carried));
      const Quaterniond back(Eigen::AngleAxisd(-excess.norm(), excess.normalized()));
      in_hand_.rotation = (hand.rotation.conjugate() * (back * wanted.rotation)).normalized();
    }
  }
  wrench.force = force;
  wrench.torque = body.center.rotation * torque;
  return wrench;
}

}  // namespace coglab_sim::plant
