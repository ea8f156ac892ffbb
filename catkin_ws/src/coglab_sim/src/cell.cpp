#include "coglab_sim/cell.hpp"

#include <cmath>
#include <stdexcept>

#include "coglab_sim/ranges.hpp"

namespace coglab_sim {
namespace {
// s for which the hand goes on as it was going after its last message; then it stands still.
constexpr double kHumanAge = 0.05;
}  // namespace

Placement placementOf(const std::string& name) {
  if (name == "human_hand") return Placement::HumanHand;
  if (name == "robot_hand") return Placement::RobotHand;
  if (name == "world") return Placement::World;
  throw std::invalid_argument("unknown placement '" + name +
                              "'; known: human_hand, robot_hand, world");
}

Cell::Cell(const CellConfig& config)
    : config_(config),
      arm_(config.urdf, config.arm, config.home),
      controller_(config.krc, config.arm, config.home),
      torque_sensor_(config.torque_noise, config.seed),
      object_(config.object, config.contact),
      loss_(config.seed, 2) {
  object_.place(placementOf(config.object_start), config.object_pose);
  arm_.setBrakes(true);
}

void Cell::setHuman(const HumanInput& human) {
  human_ = human;
  human_age_ = 0.0;
  human_present_ = true;
}

void Cell::setObject(const ObjectParameters& object) {
  object_ = ObjectPhysics(object, config_.contact);
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

const MeasurementBytes& Cell::advance(bool on_time) {
  const krc::PeriodCommand command = controller_.tick(arm_, on_time);
  arm_.setBrakes(controller_.brakesWanted());

  const double period = this->period();
  const int steps = static_cast<int>(std::ceil(period / 1e-3 - 1e-9));
  const double dt = period / steps;
  ServoCommand servo = command.servo;
  servo.velocity = (command.to - command.from) / period;
  servo.frame_velocity.linear = (command.frame_to.position - command.frame_from.position) / period;
  servo.frame_velocity.angular =
      rotationBetween(command.frame_from.rotation, command.frame_to.rotation) / period;
  for (int i = 1; i <= steps; ++i) {
    const double share = static_cast<double>(i) / steps;
    servo.position = command.from + share * (command.to - command.from);
    servo.frame.position = command.frame_from.position +
                           share * (command.frame_to.position - command.frame_from.position);
    servo.frame.rotation = command.frame_from.rotation.slerp(share, command.frame_to.rotation);
    const Pose& palm = arm_.terms().tip;
    Wrench on_palm = object_.step(palm, arm_.palmTwist(), human_, human_present_, fingers_, dt);
    on_palm.force += push_.force;
    on_palm.torque += push_.torque;
    arm_.step(servo, on_palm, dt);
    torque_sensor_.advance(arm_.velocity(), dt);
    moveHuman(dt);
  }

  losing_ = lose_next_ > 0;
  if (losing_) --lose_next_;
  sent_ = controller_.sends();
  if (sent_) {
    const krc::ArmSignals signals{arm_.position(), torque_sensor_.measured(arm_.jointTorque()),
                                  torque_sensor_.external(arm_.externalTorque(), arm_.position())};
    lwr_fri_bridge::fri::encode(controller_.measure(arm_, signals), bytes_.data());
    sent_ = !lost(loss_to_pc_);
  }
  return bytes_;
}

void Cell::moveHuman(double dt) {
  if (!human_present_) return;
  human_age_ += dt;
  if (human_age_ > kHumanAge) {
    human_.twist = Twist{};
    return;
  }
  human_.hand.position += dt * human_.twist.linear;
}

CellTruth Cell::truth() const {
  CellTruth truth;
  truth.time = controller_.time();
  truth.object = object_.pose();
  truth.object_twist = object_.twist();
  truth.human_hand = human_.hand;
  truth.robot_hand = arm_.terms().tip;
  truth.palm_force = object_.palmForce();
  truth.robot_load_share = object_.robotShare();
  truth.human_load_share = object_.humanShare();
  truth.held_by = object_.heldBy();
  truth.dropped = object_.dropped();
  truth.position = arm_.position();
  truth.velocity = arm_.velocity();
  truth.set_point = controller_.setPoint();
  truth.external_torque = arm_.externalTorque();
  return truth;
}

}  // namespace coglab_sim
