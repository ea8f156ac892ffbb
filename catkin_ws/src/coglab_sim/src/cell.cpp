#include "coglab_sim/cell.hpp"

#include <cmath>
#include <stdexcept>

#include "coglab_sim/ranges.hpp"

namespace coglab_sim {
namespace {

constexpr std::uint64_t kFrictionStream = 13;  // random stream of the friction

plant::PlantConfig plantConfig(const CellConfig& config) {
  plant::PlantConfig plant;
  plant.urdf = config.urdf;
  plant.seed = config.seed;
  plant.home = config.home;
  plant.object = config.object;
  plant.surroundings = config.surroundings;
  plant.drives = config.drives;
  Random random(config.seed, kFrictionStream);
  for (double& friction : plant.drives.coulomb_friction)
    friction *= 1.0 + config.drives.friction_spread * (2.0 * random.uniform() - 1.0);
  plant.person = config.person;
  if (!config.hand_model.empty()) plant.hand = plant::readHandTable(config.hand_model);
  return plant;
}

}  // namespace

plant::Place placeOf(const std::string& name) {
  if (name == "human_hand") return plant::Place::PersonHand;
  if (name == "robot_hand") return plant::Place::RobotHand;
  if (name == "world") return plant::Place::World;
  throw std::invalid_argument("unknown placement '" + name +
                              "'; known: human_hand, robot_hand, world");
}

Cell::Cell(const CellConfig& config)
    : config_(config),
      plant_(plantConfig(config)),
      servos_(config.urdf, config.servos, config.drives.rotor_inertia, config.seed),
      controller_(config.krc, config.servos, config.home),
      torque_sensor_(config.torque_noise, config.seed),
      palm_sensors_(config.palm_noise, config.seed),
      loss_(config.seed, 2) {
  plant_.setBrakes(true);
  plant_.setArm(config.home);
  plant_.place(placeOf(config.object_start), {config.object_position, config.object_rotation});
  servos_.observe(plant_.position(), plant_.velocity());
}

void Cell::setMotors(const MotorCommands& commands) {
  for (int i = 0; i < plant::kMotors; ++i)
    plant_.motors().command(i, commands[static_cast<std::size_t>(i)]);
}

MotorStates Cell::motors() const {
  MotorStates states;
  for (int i = 0; i < plant::kMotors; ++i)
    states[static_cast<std::size_t>(i)] = plant_.motors().state(i);
  return states;
}

void Cell::setObject(const plant::Object& object) {
  plant_.setObject(object);
  config_.object = object;
}

void Cell::setLoss(double to_pc, double from_pc) {
  requireWithin("fault/packet_loss", to_pc);
  requireWithin("fault/packet_loss", from_pc);
  loss_to_pc_ = to_pc;
  loss_from_pc_ = from_pc;
}

bool Cell::lost(double share) { return losing_ || (share > 0.0 && loss_.uniform() < share); }

void Cell::receive(const std::uint8_t* bytes, std::size_t size, double latency) {
  if (!lost(loss_from_pc_)) controller_.receive(bytes, size, latency);
}

const MeasurementBytes& Cell::step(const std::uint8_t* answer, std::size_t size) {
  if (answer != nullptr) receive(answer, size, 0.0);
  return advance(true);
}

const MeasurementBytes& Cell::advance(bool on_time, bool anew) {
  if (anew) averaged_for_ = 0.0;
  const krc::PeriodCommand command = controller_.tick(servos_, on_time);
  plant_.setBrakes(controller_.brakesWanted());

  const double period = this->period();
  const int steps = static_cast<int>(std::ceil(period / plant::kStep - 1e-9));
  const double dt = period / steps;
  krc::ServoCommand servo = command.servo;
  servo.velocity = (command.to - command.from) / period;
  servo.frame_velocity.linear = (command.frame_to.position - command.frame_from.position) / period;
  servo.frame_velocity.angular =
      rotationBetween(command.frame_from.rotation, command.frame_to.rotation) / period;
  // Torque signals are means over the period, because impacts are shorter than the sensors'
  // response.
  Vector7 torque = Vector7::Zero(), acceleration = Vector7::Zero();
  for (int i = 1; i <= steps; ++i) {
    const double share = static_cast<double>(i) / steps;
    servo.position = command.from + share * (command.to - command.from);
    servo.frame.position = command.frame_from.position +
                           share * (command.frame_to.position - command.frame_from.position);
    servo.frame.rotation = command.frame_from.rotation.slerp(share, command.frame_to.rotation);
    if (controller_.brakesWanted()) {
      servos_.off();
    } else {
      servos_.command(servo, dt);
    }
    plant_.step(servos_.motorTorque(), dt);
    servos_.observe(plant_.position(), plant_.velocity());
    torque_sensor_.advance(plant_.velocity(), dt);
    averageForces(dt);
    palm_sensors_.observe(plant_, dt);
    torque += plant_.jointTorque() / steps;
    fastest_ = i > 1 ? Vector7(fastest_.cwiseMax(plant_.velocity().cwiseAbs()))
                     : Vector7(plant_.velocity().cwiseAbs());
    acceleration += plant_.acceleration() / steps;
  }

  palm_sensors_.read();

  losing_ = lose_next_ > 0;
  if (losing_) --lose_next_;
  sent_ = controller_.sends();
  if (sent_) {
    lwr_fri_bridge::fri::encode(controller_.measure(servos_, signals(torque, acceleration)),
                                bytes_.data());
    sent_ = !lost(loss_to_pc_);
  }
  return bytes_;
}

/// Adds one physics step to the means of the forces, because a touch can last a single step.
void Cell::averageForces(double dt) {
  averaged_for_ += dt;
  const double share = dt / averaged_for_;
  const auto average = [share](auto& mean, const auto& now) { mean += share * (now - mean); };
  const plant::Touch& touch = plant_.touch();
  touch_.phalanges.resize(touch.phalanges.size(), Vector3d::Zero());
  for (std::size_t i = 0; i < touch.phalanges.size(); ++i)
    average(touch_.phalanges[i], touch.phalanges[i]);
  average(touch_.palm, touch.palm);
  average(touch_force_, plant_.touchForce());
  average(palm_force_, plant_.objectForce());
  average(external_torque_, plant_.externalTorque());
}

krc::ArmSignals Cell::signals(const Vector7& torque, const Vector7& acceleration) const {
  return {plant_.position(), torque_sensor_.measured(torque),
          torque_sensor_.external(servos_.external(torque, acceleration), plant_.position())};
}

CellTruth Cell::truth() const {
  CellTruth truth;
  truth.time = controller_.time();
  truth.object = plant_.object();
  truth.object_twist = plant_.objectTwist();
  truth.human_hand = plant_.personHand();
  truth.robot_hand = plant_.palm();
  truth.hand_closure = plant_.handClosure();
  truth.palm_force = palm_force_;
  truth.touch_force = touch_force_;
  truth.robot_load_share = plant_.robotShare();
  truth.human_load_share = plant_.personShare();
  truth.human_force = plant_.personForce();
  truth.held_by = plant_.heldBy();
  truth.dropped = plant_.dropped();
  truth.position = plant_.position();
  truth.velocity = plant_.velocity();
  truth.set_point = controller_.setPoint();
  truth.external_torque = external_torque_;
  return truth;
}

}  // namespace coglab_sim
