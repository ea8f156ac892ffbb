#include "coglab_sim/plant/plant.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace coglab_sim::plant {
namespace {

constexpr double kLockSpeed = 0.005;     // rad/s at which closed brakes hold
constexpr double kBrakeSpeed = 0.02;     // rad/s over which the brake torque reverses
constexpr double kLockInertia = 1e6;     // kg m^2 of a joint on its brake, as contacts feel it
constexpr double kFastest = 10.0;        // m/s of a free body: nothing in this cell is so fast
constexpr double kFastestJoint = 100.0;  // rad/s
constexpr double kFastestSpin = 1000.0;  // rad/s of a free body

SceneDescription sceneOf(const PlantConfig& config) {
  return {config.urdf, config.hand, config.object, config.surroundings,
          config.drives.rotor_inertia};
}

}  // namespace

Plant::Plant(const PlantConfig& config)
    : config_(config),
      model_(std::make_unique<Model>(sceneOf(config))),
      motors_(config.hand),
      position_(config.home) {
  arm_of_person_.engageAt(Pose{});
  person_.hand.position = Vector3d(1.30, 0.20, 0.15);  // where a person's hand rests
  put(model_->person_position, model_->person_velocity, person_.hand, {});
  // Until it is placed, the object is where a person would carry it.
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
  // The models differ in the object's figures alone.
  std::copy(from->qpos, from->qpos + model_->get()->nq, to->qpos);
  std::copy(from->qvel, from->qvel + model_->get()->nv, to->qvel);
  std::copy(model_->get()->opt.gravity, model_->get()->opt.gravity + 3, fresh->get()->opt.gravity);
  model_ = std::move(fresh);
  config_ = changed;
  mj_step1(model_->get(), model_->data());
}

/// Torques of motors, friction, brakes and block on the joints; what resists with the speed goes
/// into the joints' damping, which the integrator treats implicitly.
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
    // The inertias, dampers and springs of the joints that step1 has used were those of before.
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

/// Nms/rad: critical for the inertia that the joint has by itself.
double Plant::blockDamping(int dof) const {
  const mjModel* m = model_->get();
  const double stiffness = config_.drives.block_stiffness;
  return 2.0 * std::sqrt(stiffness * model_->data()->qM[m->dof_Madr[dof]]) +
         m->opt.timestep * stiffness;
}

/// Torque of the push and of the load that nobody knows of on the joints of the arm, Nm.
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

/// The body of the arm or the hand that is faster than anything here can be; 0: none is.
int Plant::tooFast() {
  const mjModel* m = model_->get();
  mjData* d = model_->data();
  mj_step1(m, d);  // the velocities of bodies are those of the step before
  const int arm = m->body_rootid[model_->palm];
  for (int body = 1; body < m->nbody; ++body) {
    if (m->body_rootid[body] != arm) continue;
    mjtNum velocity[6];  // rotation before translation, of the centre of mass
    mj_objectVelocity(m, d, mjOBJ_BODY, body, velocity, 0);
    if (!(Eigen::Map<const Vector3d>(velocity + 3).norm() < kFastest)) return body;
  }
  return 0;
}

/// What was left out of the last step for want of room, in words; empty: nothing. A contact that is
/// not there lets hands and objects pass through each other.
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
  // No sum is finite with a number in it that is not.
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
  // Nothing is farther from any joint than these reaches, so that nothing is faster than this.
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
  auto* d = const_cast<mjData*>(model_->data());  // the calls below only read it
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
  // Without the flag MuJoCo leaves the energy at 0; with it every step would compute it.
  int& flags = model_->get()->opt.enableflags;
  const int before = std::exchange(flags, flags | mjENBL_ENERGY);
  mj_energyPos(model_->get(), model_->data());
  mj_energyVel(model_->get(), model_->data());
  flags = before;
  return model_->data()->energy[0] + model_->data()->energy[1];
}

}  // namespace coglab_sim::plant
