/// @file
/// The simulated cell: robot controller, arm, object and hands behind the FRI wire.
#pragma once

#include <array>
#include <cstdint>

#include "coglab_sim/cell_config.hpp"
#include "coglab_sim/krc/controller.hpp"
#include "coglab_sim/plant/plant.hpp"

namespace coglab_sim {

using MeasurementBytes = std::array<std::uint8_t, lwr_fri_bridge::fri::kMeasurementSize>;

/// True state of the cell. Control code must not read it. Forces and torques are means over the
/// last period, because a touch can be shorter than a period.
struct CellTruth {
  double time = 0.0;  ///< s, simulated
  Pose object, human_hand, robot_hand;
  Twist object_twist;
  double hand_closure = 0.0;                ///< 0 open .. 1 closed, see Plant::handClosure()
  Vector3d palm_force = Vector3d::Zero();   ///< N, of the object on the robot hand
  Vector3d touch_force = Vector3d::Zero();  ///< N, of all contacts: Plant::touchForce()
  Vector3d human_force = Vector3d::Zero();  ///< N, on the person's hand: Plant::personForce()
  double robot_load_share = 0.0, human_load_share = 0.0;
  std::string held_by;
  bool dropped = false;
  Vector7 position, velocity, set_point;  ///< of the arm
  Vector7 external_torque;                ///< without any error, Nm
};

using MotorCommands = std::array<plant::MotorCommand, plant::kMotors>;
using MotorStates = std::array<plant::MotorState, plant::kMotors>;

/// Simulates one FRI period per call. It has no clock, thread or socket. The same configuration and
/// inputs give the same bytes.
class Cell {
 public:
  /// @throws std::invalid_argument or std::runtime_error naming the error in the configuration.
  explicit Cell(const CellConfig& config);

  /// Lockstep: takes the answer to the last measurement (none: null and 0), advances one period and
  /// returns the next measurement. `sent()` is false if FRI is closed or the packet got lost.
  const MeasurementBytes& step(const std::uint8_t* answer, std::size_t size);

  /// step() in two parts, for a real clock. First: takes one datagram that arrived `latency` s
  /// after the measurement.
  void receive(const std::uint8_t* bytes, std::size_t size, double latency);
  /// Second: advances one period. `on_time` false: the caller was late, so that a missing answer
  /// does not count against the PC. `anew` false: keep averaging forces from the previous period.
  const MeasurementBytes& advance(bool on_time = true, bool anew = true);

  bool sent() const { return sent_; }
  const MeasurementBytes& measurement() const { return bytes_; }

  // Inputs, valid until changed
  /// @throws std::invalid_argument as Plant::setPerson() does.
  void setHuman(const plant::PersonInput& human) { plant_.setPerson(human); }
  /// Commands of the hand's electronics to the five motors.
  void setMotors(const MotorCommands& commands);
  /// Adds a wrench on the palm about its origin, besides the contacts.
  void setPush(const Wrench& push) { plant_.setPush(push); }
  /// @throws std::invalid_argument as Plant::place() does.
  void place(plant::Place place, const Pose& pose) { plant_.place(place, pose); }
  /// Exchanges the object. Call place() afterwards. @throws std::invalid_argument
  void setObject(const plant::Object& object);

  // Faults
  void setBlock(bool on) { plant_.setBlock(on); }
  /// Share of lost packets, 0..1, to and from the PC.
  void setLoss(double to_pc, double from_pc);
  /// Loses the next packets in both directions.
  void loseNext(int packets) { lose_next_ = packets; }
  krc::Controller& controller() { return controller_; }
  const krc::Controller& controller() const { return controller_; }

  /// Present FRI period, s; friOpen may change it.
  double period() const { return controller_.parameters().period; }
  CellTruth truth() const;
  MotorStates motors() const;
  /// Measurement of IMU and wrench sensor in the palm at the end of the last period.
  const PalmReading& palmSensors() const { return palm_sensors_.reading(); }
  /// Contact forces on the robot's hand, means over the last period.
  const plant::Touch& touch() const { return touch_; }
  /// Largest speed of each joint within the last period, rad/s.
  const Vector7& fastest() const { return fastest_; }
  const plant::Plant& plant() const { return plant_; }
  plant::Plant& plant() { return plant_; }
  const CellConfig& config() const { return config_; }

 private:
  bool lost(double share);
  void averageForces(double dt);
  krc::ArmSignals signals(const Vector7& torque, const Vector7& acceleration) const;

  CellConfig config_;
  plant::Plant plant_;
  krc::Servos servos_;
  krc::Controller controller_;
  TorqueSensor torque_sensor_;
  PalmSensors palm_sensors_;
  Random loss_;
  double loss_to_pc_ = 0.0, loss_from_pc_ = 0.0;
  int lose_next_ = 0;
  bool losing_ = false;
  bool sent_ = false;
  Vector7 fastest_ = Vector7::Zero();
  // Means over averaged_for_ s; see CellTruth
  double averaged_for_ = 0.0;
  plant::Touch touch_;
  Vector3d touch_force_ = Vector3d::Zero(), palm_force_ = Vector3d::Zero();
  Vector7 external_torque_ = Vector7::Zero();
  MeasurementBytes bytes_{};
};

/// Place by name: human_hand, robot_hand or world. @throws std::invalid_argument for others.
plant::Place placeOf(const std::string& name);

}  // namespace coglab_sim
