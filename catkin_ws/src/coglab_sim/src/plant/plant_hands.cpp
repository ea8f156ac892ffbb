/// Object, fingers and the person's hand of the plant.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "coglab_sim/plant/plant.hpp"

namespace coglab_sim::plant {
namespace {

constexpr double kShareTime = 0.02;  // s over which load shares and the squeeze are averaged
constexpr double kPersonAge = 0.05;  // s for which the hand goes on as it went after its message
constexpr double kGripBegins = 0.05, kGripEnds = 0.02;
// m by which an object may slide in the person's hand, beyond where the grip reaches, before it is
// out of the fingers: about the length of a fingertip.
constexpr double kSlidOut = 0.02;
// What an arm follows: m that a person's hand lags at most behind where it is wanted, m/s and rad/s
// of a person's fastest reach and turn. Messages may ask for more; no arm does it.
constexpr double kLag = 0.15, kFastestReach = 5.0, kFastestTurn = 20.0;

Vector3d clipped(const Vector3d& v, double largest) {
  const double norm = v.norm();
  return norm > largest ? Vector3d(v * (largest / norm)) : v;
}

}  // namespace

double distanceFrom(const Object& object, const Vector3d& point) {
  const Vector3d p = point - object.center, half = 0.5 * object.size;
  if (object.shape == "sphere") return p.norm() - half.x();
  Vector3d beyond = p.cwiseAbs() - half;
  if (object.shape == "cylinder")
    beyond = Vector3d(std::hypot(p.x(), p.y()) - half.x(), std::abs(p.z()) - half.z(), -1.0);
  return beyond.cwiseMax(0.0).norm() + std::min(0.0, beyond.maxCoeff());
}

FreeBody Plant::freeBody(int body, int velocity) const {
  const mjModel* m = model_->get();
  const mjData* d = model_->data();
  FreeBody free;
  const mjtNum* q = d->xquat + 4 * body;
  free.center = {Eigen::Map<const Vector3d>(d->xipos + 3 * body),
                 Quaterniond(q[0], q[1], q[2], q[3])};
  free.twist.angular = free.center.rotation * Eigen::Map<const Vector3d>(d->qvel + velocity + 3);
  const Vector3d arm = free.center.position - Eigen::Map<const Vector3d>(d->xpos + 3 * body);
  free.twist.linear =
      Eigen::Map<const Vector3d>(d->qvel + velocity) + free.twist.angular.cross(arm);
  free.mass = m->body_mass[body];
  free.inertia = Eigen::Map<const Vector3d>(m->body_inertia + 3 * body);
  return free;
}

void Plant::put(int position, int velocity, const Pose& pose, const Twist& twist) {
  mjData* d = model_->data();
  const Quaterniond q = pose.rotation.normalized();
  const double values[7] = {
      pose.position.x(), pose.position.y(), pose.position.z(), q.w(), q.x(), q.y(), q.z()};
  std::copy(values, values + 7, d->qpos + position);
  const Vector3d spin = q.conjugate() * twist.angular;
  std::copy(twist.linear.data(), twist.linear.data() + 3, d->qvel + velocity);
  std::copy(spin.data(), spin.data() + 3, d->qvel + velocity + 3);
}

double Plant::handClosure() const {
  const auto& phalanges = config_.hand.phalanges;
  double sum = 0.0;
  int joints = 0;
  for (std::size_t i = 0; i < phalanges.size(); ++i) {
    if (phalanges[i].finger == Finger::Thumb) continue;
    const double angle = model_->data()->qpos[model_->phalanx_position[i]];
    sum += (angle - phalanges[i].lower) / (phalanges[i].upper - phalanges[i].lower);
    ++joints;
  }
  return joints > 0 ? sum / joints : 0.0;
}

void Plant::setPerson(const PersonInput& person) {
  PersonInput wanted = person;
  wanted.twist.linear = clipped(person.twist.linear, kFastestReach);
  wanted.twist.angular = clipped(person.twist.angular, kFastestTurn);
  if (!person_present_) appear(wanted);
  person_ = wanted;
  person_age_ = 0.0;
}

/// The person's hand is there from now on, with what was put into it; or not, if it cannot be.
void Plant::appear(const PersonInput& person) {
  const State before = state();
  put(model_->person_position, model_->person_velocity, person.hand, person.twist);
  person_present_ = true;
  keepPlaced();
  try {
    acceptOr(before, model_->person, "where it comes from");
    if (placed_) acceptOr(before, model_->object, "in that hand");
  } catch (const std::invalid_argument&) {
    person_present_ = false;
    throw;
  }
}

/// Before the person has come, their hand and what is in it stand still; what fingers are just
/// closing around stays in their palm.
void Plant::keepPlaced() {
  if (!person_present_) put(model_->person_position, model_->person_velocity, person_.hand, {});
  if (!placed_) return;
  const bool in_robot = place_ == Place::RobotHand;
  mj_kinematics(model_->get(), model_->data());
  mj_comPos(model_->get(), model_->data());
  const Pose hand = in_robot ? palm() : personHand();
  const Twist twist = in_robot ? palmTwist() : person_present_ ? twistOf(model_->person) : Twist{};
  const Pose object = hand * in_hand_;
  put(model_->object_position, model_->object_velocity, object,
      {twist.at(object.position - hand.position), twist.angular});
}

/// Whether the person's grip has the object: from where it was put, from where the fingers find it,
/// or not any more, since they have opened or it has slid out of them.
void Plant::updateGrip(const FreeBody& held, const Pose& hand) {
  const double away = distanceFrom(config_.object, object().inverse() * hand.position);
  const bool open = person_.grip<kGripEnds, closed = person_.grip> kGripBegins;
  if (placed_) {
    placed_ = grip_lost_ = false;
    grip_distance_ = away;
    if (closed) grip_.engageAt(in_hand_ * Pose{config_.object.center, Quaterniond::Identity()});
  } else if (grip_.engaged()) {
    grip_lost_ = away > std::max(config_.person.reach, grip_distance_) + kSlidOut;
    if (open || grip_lost_) grip_.release();
  } else if (open) {
    grip_lost_ = false;
  } else if (closed && !grip_lost_ && away < config_.person.reach) {
    grip_distance_ = away;
    grip_.engage(hand, held.center);
  }
}

void Plant::applyPerson(double dt) {
  mjData* d = model_->data();
  mjtNum* on_hand = d->xfrc_applied + 6 * model_->person;
  mjtNum* on_object = d->xfrc_applied + 6 * model_->object;
  std::fill(on_hand, on_hand + 6, 0.0);
  std::fill(on_object, on_object + 6, 0.0);
  const Object& object = config_.object;
  grip_force_.setZero();
  if (!person_present_) {
    put(model_->person_position, model_->person_velocity, person_.hand, {});
    return;
  }

  person_age_ += dt;
  if (person_age_ > kPersonAge) person_.twist = Twist{};
  person_.hand.position += dt * person_.twist.linear;
  const FreeBody hand = freeBody(model_->person, model_->person_velocity);
  const FreeBody held = freeBody(model_->object, model_->object_velocity);
  const Pose hand_frame = personHand();
  Pose wanted = person_.hand;
  wanted.position = hand_frame.position + clipped(wanted.position - hand_frame.position, kLag);
  Wrench hold = arm_of_person_.evaluate(wanted, person_.twist, hand, config_.person.arm, 1.0);
  arm_of_person_.engageAt(Pose{});  // an arm that was pushed aside comes back

  const double friction = 2.0 * object.friction * person_.grip * person_.grip_force;
  updateGrip(held, hand_frame);
  if (grip_.engaged()) {
    const HoldFigures figures{config_.person.grip_bandwidth, friction,
                              friction * config_.person.grip_lever};
    const Wrench by_person = grip_.evaluate(hand_frame, twistOf(model_->person), held, figures,
                                            std::clamp(person_.grip, 0.0, 1.0));
    grip_force_ = by_person.force;
    std::copy(by_person.force.data(), by_person.force.data() + 3, on_object);
    std::copy(by_person.torque.data(), by_person.torque.data() + 3, on_object + 3);
    hold.force -= by_person.force;
    hold.torque -=
        by_person.torque + (held.center.position - hand.center.position).cross(by_person.force);
  }
  std::copy(hold.force.data(), hold.force.data() + 3, on_hand);
  std::copy(hold.torque.data(), hold.torque.data() + 3, on_hand + 3);
}

/// Adds what one body of a contact feels, in world axes; `normal` is the pressing part, N.
void Plant::feel(int body, int other, const Vector3d& force, double normal, Pressing& pressing) {
  const auto phalanx = std::find(model_->phalanges.begin(), model_->phalanges.end(), body);
  const bool on_palm = body == model_->palm;
  if (phalanx == model_->phalanges.end() && !on_palm) return;
  const auto index = static_cast<std::size_t>(phalanx - model_->phalanges.begin());
  (on_palm ? touch_.palm : touch_.phalanges[index]) += force;
  if (other != model_->object) return;
  pressing.on_object -= force;
  const bool finger = !on_palm && config_.hand.phalanges[index].finger != Finger::Thumb;
  (finger ? pressing.fingers : pressing.opposing) += normal;
}

/// Who touches what: forces on the fingers and the palm, who carries the object.
void Plant::readContacts(double dt) {
  const mjModel* m = model_->get();
  const mjData* d = model_->data();
  touch_.phalanges.assign(model_->phalanges.size(), Vector3d::Zero());
  touch_.palm.setZero();
  on_board_ = on_floor_ = false;
  contacts_ = d->ncon;
  Pressing pressing;
  for (int i = 0; i < d->ncon; ++i) {
    const mjContact& contact = d->contact[i];
    if (contact.efc_address < 0) continue;
    const int one = m->geom_bodyid[contact.geom1], two = m->geom_bodyid[contact.geom2];
    if (one == model_->object || two == model_->object) {
      const int with = one == model_->object ? contact.geom2 : contact.geom1;
      on_board_ = on_board_ || with == model_->board;
      on_floor_ = on_floor_ || with == model_->floor;
    }
    mjtNum local[6];
    mj_contactForce(m, d, i, local);
    // Rows of the frame are normal and tangents; the force acts on the second body.
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> frame(contact.frame);
    const Vector3d force = frame.transpose() * Vector3d(local[0], local[1], local[2]);
    feel(one, two, -force, local[0], pressing);
    feel(two, one, force, local[0], pressing);
  }
  touch_force_ = touch_.palm;
  for (const Vector3d& force : touch_.phalanges) touch_force_ += force;
  const Matrix3d to_palm = palm().rotation.toRotationMatrix().transpose();
  for (Vector3d& force : touch_.phalanges) force = to_palm * force;
  touch_.palm = to_palm * touch_.palm;
  object_force_ = -pressing.on_object;
  dropped_ = dropped_ || on_floor_;

  const double keep = std::exp(-dt / kShareTime), weight = config_.object.mass * kGravity;
  const double opposed = std::min(pressing.fingers, pressing.opposing);
  const auto average = [&](double& value, double now) {
    value = keep * value + (1.0 - keep) * now;
  };
  average(robot_share_, std::clamp(pressing.on_object.z() / weight, 0.0, 1.0));
  average(person_share_, std::clamp(grip_force_.z() / weight, 0.0, 1.0));
  average(squeeze_, opposed);
  average(grasp_force_, opposed > 0.0 ? pressing.fingers + pressing.opposing : 0.0);
  // People know how their own hand moves: what that alone asks of the grip is not felt as a load.
  Vector3d felt = Vector3d::Zero();
  if (grip_.engaged())
    felt = config_.object.mass * Eigen::Map<const Vector3d>(d->qacc + model_->person_velocity) -
           grip_force_;
  person_force_ = keep * person_force_ + (1.0 - keep) * felt;
}

std::string Plant::heldBy() const {
  const bool robot = robotHolds(),
             person = grip_.engaged() || (placed_ && place_ == Place::PersonHand);
  if (robot && person) return "both";
  if (robot) return "robot";
  if (person) return "human";
  if (on_board_) return "board";
  return on_floor_ ? "floor" : "none";
}

}  // namespace coglab_sim::plant
