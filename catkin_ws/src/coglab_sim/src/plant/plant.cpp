#include "coglab_sim/plant/plant.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "overlap.hpp"

namespace coglab_sim::plant {
namespace {

constexpr double kLockSpeed = 0.005;     // rad/s below which closed brakes hold
constexpr double kBrakeSpeed = 0.02;     // rad/s over which the brake torque reverses
constexpr double kLockInertia = 1e6;     // kg m^2, effective inertia of a braked joint in contacts
constexpr double kFastest = 10.0;        // m/s, plausible limit of a free body
constexpr double kFastestJoint = 100.0;  // rad/s
constexpr double kFastestSpin = 1000.0;  // rad/s, of a free body

constexpr double kShareTime = 0.02;  // s, averaging time of load shares and squeeze
constexpr double kPersonAge = 0.1;   // s after a message during which the hand keeps its velocity
constexpr double kGripBegins = 0.05, kGripEnds = 0.02;  // grip 0..1 of the person's hand
// m that an object may slide in the person's hand beyond the grip's reach before the fingers lose
// it: about the length of a fingertip.
constexpr double kSlidOut = 0.02;
// Limits of a person's arm: largest lag behind the commanded hand (m), fastest reach (m/s) and turn
// (rad/s). Messages beyond them are limited.
constexpr double kLag = 0.15, kFastestReach = 5.0, kFastestTurn = 20.0;

constexpr double kInside = 0.003;  // m, largest overlap in a start state
// m, largest overlap of the object with a phalanx, which yields: less than half of its thickness.
constexpr double kInFinger = 0.008;

// Grasp of the robot's hand in a start state: positions (bytes) of the five motors for the
// cylindrical grasp (thumb opposed, all others nearly open), and the current at which they stop,
// half of the current that the tension limit adds. Our choice.
constexpr std::array<double, kMotors> kPreshape = {245 / 255.0, 5 / 255.0, 30 / 255.0, 50 / 255.0,
                                                   50 / 255.0};
constexpr double kCloseCurrent = 240.0;                         // counts
constexpr int kOpening = 300, kClosing = 2500, kHanging = 300;  // steps
constexpr double kCarries = 1.5;  // smallest ratio of friction to weight of a hanging object
constexpr double kStays = 0.02;   // m, largest motion of the hanging object in the palm

SceneDescription sceneOf(const PlantConfig& config) {
  return {config.urdf, config.hand, config.object, config.surroundings,
          config.drives.rotor_inertia};
}

Vector3d clipped(const Vector3d& v, double largest) {
  const double norm = v.norm();
  return norm > largest ? Vector3d(v * (largest / norm)) : v;
}

}  // namespace

Plant::Plant(const PlantConfig& config)
    : config_(config),
      model_(std::make_unique<Model>(sceneOf(config))),
      motors_(config.hand),
      position_(config.home) {
  arm_of_person_.engageAt(Pose{});
  person_.hand.position = Vector3d(1.30, 0.20, 0.15);  // rest position of a person's hand
  put(model_->person_position, model_->person_velocity, person_.hand, {});
  // Until the object is placed, it is where a person would carry it.
  place_ = Place::PersonHand;
  placed_ = true;
  in_hand_.position = Vector3d(-0.08, 0.0, -0.05);
  reach_ = model_->reach();
  double finger = 0.0;
  for (const Phalanx& phalanx : config.hand.phalanges) {
    finger = (phalanx.first ? 0.0 : finger + phalanx.pivot.norm()) + phalanx.length;
    finger_reach_ = std::max(finger_reach_, finger);
  }
  setArm(config.home);
  refuseOverlap(-1, "at the start");
}

void Plant::setArm(const Vector7& position, const Vector7& velocity) {
  mjData* d = model_->data();
  position_ = block_position_ = position;
  velocity_ = velocity;
  for (std::size_t i = 0; i < 7; ++i) {
    d->qpos[model_->arm_position[i]] = position[static_cast<Eigen::Index>(i)];
    d->qvel[model_->arm_velocity[i]] = velocity[static_cast<Eigen::Index>(i)];
  }
  keepPlaced();
  mj_step1(model_->get(), d);
  for (std::size_t i = 0; i < 7; ++i)
    joint_torque_[static_cast<Eigen::Index>(i)] = d->qfrc_bias[model_->arm_velocity[i]];
  external_torque_.setZero();
  acceleration_.setZero();
  locked_ = brakes_;
}

void Plant::setBrakes(bool on) {
  brakes_ = on;
  if (!on) locked_ = false;
}

void Plant::setBlock(bool on) {
  if (on && !blocked_) block_position_ = position_;
  blocked_ = on;
}

void Plant::setGravity(const Vector3d& gravity) {
  std::copy(gravity.data(), gravity.data() + 3, model_->get()->opt.gravity);
  mj_step1(model_->get(), model_->data());
}

void Plant::setObject(const Object& object) {
  PlantConfig changed = config_;
  changed.object = object;
  auto fresh = std::make_unique<Model>(sceneOf(changed));
  mjData *to = fresh->data(), *from = model_->data();
  // The models differ only in the values of the object.
  std::copy(from->qpos, from->qpos + model_->get()->nq, to->qpos);
  std::copy(from->qvel, from->qvel + model_->get()->nv, to->qvel);
  std::copy(model_->get()->opt.gravity, model_->get()->opt.gravity + 3, fresh->get()->opt.gravity);
  model_ = std::move(fresh);
  config_ = changed;
  mj_step1(model_->get(), model_->data());
}

/// Applies torques of motors, friction, brakes and block to the joints. Resistance that depends on
/// speed becomes joint damping, which the integrator treats implicitly.
void Plant::applyArm(const Vector7& motor_torque) {
  mjModel* m = model_->get();
  mjData* d = model_->data();
  const Drives& drives = config_.drives;
  motor_torque_ = brakes_ ? Vector7::Zero() : motor_torque;
  for (std::size_t i = 0; i < 7; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const int dof = model_->arm_velocity[i], joint = m->dof_jntid[dof];
    const double speed = velocity_[k];
    friction_[k] =
        -drives.coulomb_friction[k] * speed / std::max(std::abs(speed), drives.coulomb_speed);
    if (brakes_)
      m->dof_damping[dof] += drives.brake_torque[k] / std::max(std::abs(speed), kBrakeSpeed);
    m->dof_armature[dof] = locked_ ? kLockInertia : drives.rotor_inertia[k];
    m->jnt_stiffness[joint] = blocked_ ? drives.block_stiffness : 0.0;
    m->qpos_spring[model_->arm_position[i]] = block_position_[k];
    if (blocked_) m->dof_damping[dof] += blockDamping(dof);
    d->qfrc_applied[dof] = locked_ ? 0.0 : motor_torque_[k] + friction_[k];
  }
  Wrench outside = push_;
  outside.force.z() -= kGravity * drives.unknown_load;
  mjtNum* applied = d->xfrc_applied + 6 * model_->palm;
  const Vector3d arm = palm().position - Eigen::Map<const Vector3d>(d->xipos + 3 * model_->palm);
  const Vector3d torque = outside.torque + arm.cross(outside.force);
  std::copy(outside.force.data(), outside.force.data() + 3, applied);
  std::copy(torque.data(), torque.data() + 3, applied + 3);
}

void Plant::applyMotors(double dt) {
  mjData* d = model_->data();
  std::array<double, kMotors> tension;
  for (std::size_t i = 0; i < kMotors; ++i) tension[i] = d->actuator_force[i];
  motors_.step(tension, dt);
  for (int i = 0; i < kMotors; ++i) d->ctrl[i] = motors_.wound(i);
}

void Plant::step(const Vector7& motor_torque, double dt) {
  if (!(dt > 0.0 && dt <= kStep + 1e-12))
    throw std::invalid_argument("a step of the plant is at most 0.001 s, asked for " +
                                std::to_string(dt));
  if (!motor_torque.allFinite())
    throw std::invalid_argument("a motor torque is not a finite number");
  mjModel* m = model_->get();
  mjData* d = model_->data();
  m->opt.timestep = dt;
  const Vector7 before = velocity_;
  std::array<double, 7> damping;
  for (std::size_t i = 0; i < 7; ++i) damping[i] = m->dof_damping[model_->arm_velocity[i]];
  if (placed_) {
    keepPlaced();
    mj_step1(m, d);
  }
  applyArm(motor_torque);
  const bool stiff = brakes_ || blocked_;
  if (stiff || was_stiff_) {
    // step1 has used the previous inertias, dampers and springs of the joints.
    mj_crb(m, d);
    mj_factorM(m, d);
    mj_passive(m, d);
  }
  was_stiff_ = stiff;
  applyPerson(dt);
  applyMotors(dt);
  mj_step2(m, d);
  time_ += dt;
  readContacts(dt);
  readArm(before, dt);
  for (std::size_t i = 0; i < 7; ++i) m->dof_damping[model_->arm_velocity[i]] = damping[i];
  check();
  mj_step1(m, d);
}

/// Critical damping for the joint's own inertia, Nms/rad.
double Plant::blockDamping(int dof) const {
  const mjModel* m = model_->get();
  const double stiffness = config_.drives.block_stiffness;
  return 2.0 * std::sqrt(stiffness * model_->data()->qM[m->dof_Madr[dof]]) +
         m->opt.timestep * stiffness;
}

/// Torque of the push and of the unknown load on the joints of the arm, Nm.
Vector7 Plant::pushedTorque() const {
  const mjModel* m = model_->get();
  const mjData* d = model_->data();
  Wrench outside = push_;
  outside.force.z() -= kGravity * config_.drives.unknown_load;
  const Vector3d point = Eigen::Map<const Vector3d>(d->xpos + 3 * model_->palm_frame);
  Vector7 torque;
  for (std::size_t i = 0; i < 7; ++i) {
    const int joint = m->dof_jntid[model_->arm_velocity[i]];
    const Vector3d arm = point - Eigen::Map<const Vector3d>(d->xanchor + 3 * joint);
    torque[static_cast<Eigen::Index>(i)] = Eigen::Map<const Vector3d>(d->xaxis + 3 * joint)
                                               .dot(arm.cross(outside.force) + outside.torque);
  }
  return torque;
}

void Plant::readArm(const Vector7& before, double dt) {
  const mjModel* m = model_->get();
  mjData* d = model_->data();
  const Drives& drives = config_.drives;
  if (brakes_ && !locked_) {
    locked_ = std::all_of(model_->arm_velocity.begin(), model_->arm_velocity.end(),
                          [&](int dof) { return std::abs(d->qvel[dof]) < kLockSpeed; });
    for (std::size_t i = 0; locked_ && i < 7; ++i)
      position_[static_cast<Eigen::Index>(i)] = d->qpos[model_->arm_position[i]];
  }
  const Vector7 pushed = pushedTorque();
  for (std::size_t i = 0; i < 7; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const int dof = model_->arm_velocity[i], at = model_->arm_position[i];
    external_torque_[k] = d->qfrc_constraint[dof] + pushed[k];
    if (locked_) {
      d->qpos[at] = position_[k];
      d->qvel[dof] = velocity_[k] = acceleration_[k] = 0.0;
      joint_torque_[k] = d->qfrc_bias[dof] - external_torque_[k];
      continue;
    }
    double resistance = m->dof_damping[dof];
    const double speed = d->qvel[dof];
    if (blocked_) {
      const double damping = blockDamping(dof);
      resistance -= damping;
      external_torque_[k] +=
          drives.block_stiffness * (block_position_[k] - position_[k]) - damping * speed;
    }
    position_[k] = d->qpos[at];
    velocity_[k] = speed;
    acceleration_[k] = (speed - before[k]) / dt;
    joint_torque_[k] = motor_torque_[k] + friction_[k] - resistance * speed -
                       drives.rotor_inertia[k] * acceleration_[k];
  }
}

/// Body of the arm or the hand that is faster than plausible; 0: none.
int Plant::tooFast() {
  const mjModel* m = model_->get();
  mjData* d = model_->data();
  mj_step1(m, d);  // body velocities are those of the previous step
  const int arm = m->body_rootid[model_->palm];
  for (int body = 1; body < m->nbody; ++body) {
    if (m->body_rootid[body] != arm) continue;
    mjtNum velocity[6];  // rotation before translation, of the centre of mass
    mj_objectVelocity(m, d, mjOBJ_BODY, body, velocity, 0);
    if (!(Eigen::Map<const Vector3d>(velocity + 3).norm() < kFastest)) return body;
  }
  return 0;
}

/// Message about contacts or constraints that MuJoCo left out of the last step for lack of room;
/// empty: none. Without a contact, hands and objects pass through each other.
std::string Plant::leftOut() const {
  const mjWarningStat* warnings = model_->data()->warning;
  if (warnings[mjWARN_CONTACTFULL].number > 0)
    return "more than " + std::to_string(model_->get()->nconmax) + " contacts at a time";
  if (warnings[mjWARN_CNSTRFULL].number > 0)
    return "more than " + std::to_string(model_->get()->njmax) + " constraints at a time";
  return "";
}

void Plant::check() {
  const mjModel* m = model_->get();
  const mjData* d = model_->data();
  const auto free = [&](int at) {
    return Eigen::Map<const Vector3d>(d->qvel + at).norm() < kFastest &&
           Eigen::Map<const Vector3d>(d->qvel + at + 3).norm() < kFastestSpin;
  };
  double arm = 0.0, arm_fastest = 0.0, fingers = 0.0, fingers_fastest = 0.0;
  for (const int dof : model_->arm_velocity) {
    arm += std::abs(d->qvel[dof]);
    arm_fastest = std::max(arm_fastest, std::abs(d->qvel[dof]));
  }
  for (const int dof : model_->phalanx_velocity) {
    fingers += std::abs(d->qvel[dof]);
    fingers_fastest = std::max(fingers_fastest, std::abs(d->qvel[dof]));
  }
  // A sum is finite only if all its terms are.
  const double all = Eigen::Map<const Eigen::VectorXd>(d->qpos, m->nq).sum();
  bool warned = !std::isfinite(all) || !std::isfinite(arm + fingers);
  for (const int kind : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC})
    warned = warned || d->warning[kind].number > 0;
  std::string what = warned                               ? "a value is no number"
                     : !free(model_->object_velocity)     ? "the object"
                     : !free(model_->person_velocity)     ? "the person's hand"
                     : !(arm_fastest < kFastestJoint)     ? "a joint of the arm"
                     : !(fingers_fastest < kFastestJoint) ? "a joint of a finger"
                                                          : "";
  const std::string left_out = leftOut();
  // Upper bound of the speed: nothing is farther from any joint than these reaches.
  if (what.empty() && left_out.empty() && !(reach_ * arm + finger_reach_ * fingers < kFastest)) {
    if (const int body = tooFast(); body != 0) what = mj_id2name(m, mjOBJ_BODY, body);
  }
  if (what.empty() && left_out.empty()) return;
  const std::string fast = " is faster than anything here can be (10 m/s, 100 rad/s)";
  std::ostringstream text;
  text << "the simulation diverged at " << time_ << " s with seed " << config_.seed << ": "
       << (what.empty() ? left_out
           : warned     ? what
                        : what + fast)
       << "; the same seed and inputs repeat it";
  throw std::runtime_error(text.str());
}

Twist Plant::twistOf(int body) const {
  mjtNum velocity[6];  // rotation before translation
  mj_objectVelocity(model_->get(), model_->data(), mjOBJ_XBODY, body, velocity, 0);
  return {Vector3d(velocity[3], velocity[4], velocity[5]),
          Vector3d(velocity[0], velocity[1], velocity[2])};
}

Plant::Terms Plant::terms() const {
  const mjModel* m = model_->get();
  auto* d = const_cast<mjData*>(model_->data());  // the calls below do not change it
  Terms terms;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> mass(m->nv, m->nv),
      linear(3, m->nv), angular(3, m->nv);
  mj_fullM(m, mass.data(), d->qM);
  mj_jacBody(m, d, linear.data(), angular.data(), model_->palm_frame);
  terms.mass = mass;
  terms.bias = Eigen::Map<const Eigen::VectorXd>(d->qfrc_bias, m->nv);
  terms.jacobian.resize(6, m->nv);
  terms.jacobian << linear, angular;
  terms.arm.assign(model_->arm_velocity.begin(), model_->arm_velocity.end());
  terms.fingers = model_->phalanx_velocity;
  for (int i = 0; i < 6; ++i) terms.object.push_back(model_->object_velocity + i);
  return terms;
}

double Plant::energy() {
  // Without the flag MuJoCo leaves the energy at 0; with it, every step computes the energy.
  int& flags = model_->get()->opt.enableflags;
  const int before = std::exchange(flags, flags | mjENBL_ENERGY);
  mj_energyPos(model_->get(), model_->data());
  mj_energyVel(model_->get(), model_->data());
  flags = before;
  return model_->data()->energy[0] + model_->data()->energy[1];
}

// ------------------------------------------------------------------------------------------------
// object, fingers and the person's hand

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
  if (!person_present_) addPerson(wanted);
  person_ = wanted;
  person_age_ = 0.0;
}

/// Adds the person's hand with the object placed in it. Leaves it out if it would overlap
/// something.
void Plant::addPerson(const PersonInput& person) {
  const State before = state();
  put(model_->person_position, model_->person_velocity, person.hand, person.twist);
  person_present_ = true;
  keepPlaced();
  try {
    acceptOrRestore(before, model_->person, "where it comes from");
    if (placed_) acceptOrRestore(before, model_->object, "in that hand");
  } catch (const std::invalid_argument&) {
    person_present_ = false;
    throw;
  }
}

/// Keeps hand and object still until the person comes, and keeps an object in the robot's palm
/// while the fingers close.
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

/// Starts or ends the person's grip. It starts where the object was placed or where the fingers
/// meet it. It ends when the fingers open or the object slides out.
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
  const PersonParameters& p = config_.person;
  Wrench hold = arm_of_person_.evaluate(wanted, person_.twist, hand,
                                        {p.arm_bandwidth, p.arm_force, p.arm_torque}, 1.0);
  arm_of_person_.engageAt(Pose{});  // a displaced arm comes back

  const double friction = 2.0 * object.friction * person_.grip * person_.grip_force;
  updateGrip(held, hand_frame);
  if (grip_.engaged()) {
    const HoldLimits limits{p.grip_bandwidth, friction, friction * p.grip_lever};
    const Wrench by_person = grip_.evaluate(hand_frame, twistOf(model_->person), held, limits,
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

/// Adds the contact force on one body, world axes; `normal` is its pressing part, N.
void Plant::addContact(int body, int other, const Wrench& load, double normal, Pressing& pressing) {
  const auto phalanx = std::find(model_->phalanges.begin(), model_->phalanges.end(), body);
  const bool on_palm = body == model_->palm;
  if (phalanx == model_->phalanges.end() && !on_palm) return;
  const auto index = static_cast<std::size_t>(phalanx - model_->phalanges.begin());
  (on_palm ? touch_.palm : touch_.phalanges[index]) += load.force;
  touch_torque_ += load.torque;
  if (other != model_->object) return;
  pressing.on_object -= load.force;
  const bool finger = !on_palm && config_.hand.phalanges[index].finger != Finger::Thumb;
  (finger ? pressing.fingers : pressing.opposing) += normal;
}

/// Reads the contacts: forces on fingers and palm, and shares of the object's weight.
void Plant::readContacts(double dt) {
  const mjModel* m = model_->get();
  const mjData* d = model_->data();
  touch_.phalanges.assign(model_->phalanges.size(), Vector3d::Zero());
  touch_.palm.setZero();
  touch_torque_.setZero();
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
    // The rows of the frame are normal and tangents. The force acts on the second body.
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> frame(contact.frame);
    const Vector3d force = frame.transpose() * Vector3d(local[0], local[1], local[2]);
    const Vector3d arm = Eigen::Map<const Vector3d>(contact.pos) - palm().position;
    const Vector3d torque = arm.cross(force);
    addContact(one, two, {-force, -torque}, local[0], pressing);
    addContact(two, one, {force, torque}, local[0], pressing);
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
  // People know the motion of their own hand: the force that accelerates the object is not felt as
  // load.
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

// ------------------------------------------------------------------------------------------------
// overlap checks: placed object, surroundings, person's hand

std::string Plant::nameOf(int geom) const {
  const mjModel* m = model_->get();
  const int body = m->geom_bodyid[geom];
  if (body == model_->object) return "object '" + config_.object.id + "'";
  if (body == model_->person) return "the person's hand";
  const char* name = body == 0 ? mj_id2name(m, mjOBJ_GEOM, geom) : mj_id2name(m, mjOBJ_BODY, body);
  return name != nullptr ? name : "something";
}

/// True if two geoms must not overlap: they collide, or are object and forearm.
bool Plant::excludeEachOther(int one, int two) const {
  const mjModel* m = model_->get();
  const int first = m->geom_bodyid[one], second = m->geom_bodyid[two];
  const auto root = [&](int body) { return m->body_rootid[body] == m->body_rootid[model_->palm]; };
  if (m->body_weldid[first] == m->body_weldid[second]) return false;
  // The arm's guard detects an arm that touches itself; neighbouring links overlap in the
  // description.
  if (root(first) && root(second)) return false;
  // The person's fingers close on the object without collision; the forearm is solid.
  if ((first == model_->object && second == model_->person) ||
      (second == model_->object && first == model_->person))
    return true;
  return (m->geom_contype[one] & m->geom_conaffinity[two]) != 0 ||
         (m->geom_contype[two] & m->geom_conaffinity[one]) != 0;
}

/// Throws if a body (-1: any except the object) overlaps something too deeply.
void Plant::refuseOverlap(int body, const char* where) const {
  const mjModel* m = model_->get();
  const auto deepest = [&](bool in_finger) {
    return deepestOverlap(m, model_->data(), [&](int one, int two) {
      const int first = m->geom_bodyid[one], second = m->geom_bodyid[two];
      const auto either = [&](int which) { return first == which || second == which; };
      if (body < 0 ? either(model_->object) : !either(body)) return false;
      const bool finger = either(model_->object) &&
                          std::any_of(model_->phalanges.begin(), model_->phalanges.end(), either);
      return finger == in_finger && excludeEachOther(one, two);
    });
  };
  Overlap found = deepest(false);
  double most = kInside;
  if (found.depth <= most) {
    found = deepest(true);
    most = kInFinger;
  }
  if (found.depth <= most) return;
  const bool swap = m->geom_bodyid[found.two] == model_->object ||
                    (body >= 0 && m->geom_bodyid[found.two] == body);
  std::ostringstream text;
  text.precision(3);
  text << nameOf(swap ? found.two : found.one) << " would stand " << 1e3 * found.depth
       << " mm inside " << nameOf(swap ? found.one : found.two) << ' ' << where << ", at most "
       << 1e3 * most << " mm are accepted; place it elsewhere";
  throw std::invalid_argument(text.str());
}

Plant::State Plant::state() const {
  const mjModel* m = model_->get();
  const mjData* d = model_->data();
  return {{d->qpos, d->qpos + m->nq}, {d->qvel, d->qvel + m->nv}};
}

/// Updates all quantities for the present positions. If a body overlaps something, restores the
/// previous state and throws.
void Plant::acceptOrRestore(const State& before, int body, const char* where) {
  mjData* d = model_->data();
  mj_step1(model_->get(), d);
  try {
    refuseOverlap(body, where);
  } catch (const std::invalid_argument&) {
    std::copy(before.position.begin(), before.position.end(), d->qpos);
    std::copy(before.velocity.begin(), before.velocity.end(), d->qvel);
    mj_step1(model_->get(), d);
    throw;
  }
}

void Plant::place(Place place, const Pose& pose) {
  if (place == Place::RobotHand) {
    placeInRobotHand(pose);
    return;
  }
  const State before = state();
  const bool in_hand = place == Place::PersonHand;
  const Pose hand = personHand(), object = in_hand ? hand * pose : pose;
  Twist twist;
  if (in_hand && person_present_) {
    const Twist with = twistOf(model_->person);
    twist = {with.at(object.position - hand.position), with.angular};
  }
  put(model_->object_position, model_->object_velocity, object, twist);
  acceptOrRestore(before, model_->object, in_hand ? "in that hand" : "there");
  resetObject();
  place_ = place;
  in_hand_ = pose;
  placed_ = in_hand;
}

/// Resets the holders of an object that has just been placed.
void Plant::resetObject() {
  grip_.release();
  placed_ = grip_lost_ = false;
  on_board_ = on_floor_ = dropped_ = false;
  robot_share_ = person_share_ = squeeze_ = grasp_force_ = 0.0;
  object_force_.setZero();
  person_force_.setZero();
}

/// Tries the grasp on a copy of the plant: the arm stands on its brakes in the same posture, and
/// the fingers close on the object. The result is adopted only if they hold it.
void Plant::placeInRobotHand(const Pose& in_palm) {
  PlantConfig config = config_;
  config.home = position_;
  Plant copy(config);
  std::copy(model_->get()->opt.gravity, model_->get()->opt.gravity + 3,
            copy.model_->get()->opt.gravity);
  copy.closeAround(in_palm);

  mjData* d = model_->data();
  const mjData* from = copy.model_->data();
  const State before = state();
  for (std::size_t i = 0; i < model_->phalanx_position.size(); ++i) {
    d->qpos[model_->phalanx_position[i]] = from->qpos[model_->phalanx_position[i]];
    d->qvel[model_->phalanx_velocity[i]] = 0.0;
  }
  const Pose palm = this->palm(), object = palm * (copy.palm().inverse() * copy.object());
  const Twist twist = palmTwist();
  put(model_->object_position, model_->object_velocity, object,
      {twist.at(object.position - palm.position), twist.angular});
  std::copy(from->qacc_warmstart, from->qacc_warmstart + model_->get()->nv, d->qacc_warmstart);
  acceptOrRestore(before, model_->object, "in that hand");
  resetObject();
  place_ = Place::RobotHand;
  motors_ = copy.motors_;
  robot_share_ = copy.robot_share_;
  squeeze_ = copy.squeeze_;
  grasp_force_ = copy.grasp_force_;
  object_force_ = copy.object_force_;
}

/// Closes the hand of this (temporary) plant on the object, which is kept at its pose in the palm,
/// and then lets it hang. Throws if the fingers do not hold it there.
void Plant::closeAround(const Pose& in_palm) {
  const Vector7 off = Vector7::Zero();
  setBrakes(true);
  setArm(position_);
  locked_ = true;
  for (int motor = 0; motor < kMotors; ++motor)
    motors_.set(motor, kPreshape[static_cast<std::size_t>(motor)]);
  for (int i = 0; i < kOpening; ++i) step(off);
  place(Place::World, palm() * in_palm);
  place_ = Place::RobotHand;
  in_hand_ = in_palm;
  placed_ = true;
  for (int motor = 1; motor < kMotors; ++motor) motors_.command(motor, {1.0, 1.0, kCloseCurrent});
  const auto closing = [&] {
    for (int motor = 1; motor < kMotors; ++motor) {
      const MotorState& state = motors_.state(motor);
      if (!state.locked && state.position < 1.0 - 1e-5) return true;
    }
    return false;
  };
  const Object& thing = config_.object;
  for (int i = 0; i < kClosing && closing(); ++i) {
    step(off);
    placed_ = placed_ && thing.friction * grasp_force_ < kCarries * thing.mass * kGravity;
  }
  placed_ = false;
  for (int i = 0; i < kHanging; ++i) step(off);
  const double moved = ((palm().inverse() * object()).position - in_palm.position).norm();
  if (robotHolds() && moved <= kStays) return;
  std::ostringstream text;
  text.precision(3);
  text << "object '" << config_.object.id << "' cannot be placed in the robot's hand there: "
       << "closed around it, the fingers "
       << (robotHolds() ? "move it by " + std::to_string(static_cast<int>(1e3 * moved)) + " mm"
                        : std::string("do not hold it"))
       << "; place it within their reach, before the palm";
  throw std::invalid_argument(text.str());
}

}  // namespace coglab_sim::plant
