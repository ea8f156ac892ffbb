/// @file
/// The physics of the cell: arm, hand with fingers, object, person's hand, board and floor. MuJoCo
/// moves them in steps of 1 ms.
///
/// The robot grasps by contact and friction only. The person holds an object by a compliant,
/// limited spring, and the person's hand is a body on another such spring. A diverging simulation
/// stops with an error that names seed and time.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "coglab_sim/plant/hand_motors.hpp"
#include "coglab_sim/plant/hold_spring.hpp"
#include "coglab_sim/plant/model.hpp"

namespace coglab_sim::plant {

constexpr double kStep = 1e-3;  ///< s, longest step

/// The arm's drives. Defaults, units and texts are in parameter_table.inc.
struct Drives {
#define DRIVES(type, field, value, ...) type field = value;
#include "coglab_sim/parameter_table.inc"
};

/// The person's hand.
struct PersonParameters {
#define PERSON(type, field, value, ...) type field = value;
#include "coglab_sim/parameter_table.inc"
};

struct PlantConfig {
  std::string urdf;        ///< path of the robot description
  std::uint64_t seed = 1;  ///< seed of the run, for messages; the plant uses no random numbers
  Vector7 home = Vector7::Zero();
  HandTable hand = builtInHandTable();
  Object object;
  Surroundings surroundings;
  Drives drives;
  PersonParameters person;
};

/// Motion and grip of the person's hand.
struct PersonInput {
  Pose hand;
  Twist twist;
  double grip = 0.0;         ///< 0 open .. 1 full
  double grip_force = 20.0;  ///< N, normal force at full grip
};

/// Places for the object. Afterwards only contacts, gravity and the person's grip move it.
enum class Place {
  /// Pose of the object in human_hand. The person's grip begins there with its present force. Hand
  /// and object stand still until the hand moves for the first time.
  PersonHand,
  /// Pose of the object in ih2_palm. A start state: object and arm are kept still while the open
  /// hand closes, then the object hangs in the fingers.
  RobotHand,
  World  ///< pose of the object in the world; it is free at once
};

/// Forces of the surroundings on the hand, N, axes of ih2_palm.
struct Touch {
  std::vector<Vector3d> phalanges;  ///< in the order of the hand's table
  Vector3d palm = Vector3d::Zero();
};

class Plant {
 public:
  /// @throws std::invalid_argument or std::runtime_error naming the value that does not fit, or two
  /// bodies that overlap by more than 3 mm.
  explicit Plant(const PlantConfig& config);

  /// Advances by `dt` s (at most kStep) with the motor torques (Nm at the joints).
  /// @throws std::runtime_error with seed and time when the simulation diverges.
  void step(const Vector7& motor_torque, double dt = kStep);

  // Inputs, valid until changed
  /// @throws std::invalid_argument if the hand appears for the first time and overlaps something by
  /// more than 3 mm; it is then left out.
  void setPerson(const PersonInput& person);
  void setPush(const Wrench& push) { push_ = push; }  ///< on ih2_palm about its origin
  void setBrakes(bool on);                            ///< motors without torque, brakes closed
  void setBlock(bool on);                             ///< a person holds all joints in place
  HandMotors& motors() { return motors_; }
  const HandMotors& motors() const { return motors_; }
  /// @throws std::invalid_argument if the object would overlap something by more than 3 mm, or the
  /// robot's fingers would not hold it at this pose. Nothing is changed then.
  void place(Place place, const Pose& pose);
  /// Exchanges the object. Call place() afterwards. The robot does not change.
  void setObject(const Object& object);
  /// Sets gravity (world, m/s^2), for tests.
  void setGravity(const Vector3d& gravity);
  /// Sets joint positions (rad) and velocities (rad/s) of the arm.
  void setArm(const Vector7& position, const Vector7& velocity = Vector7::Zero());

  // The arm
  Vector7 position() const { return position_; }
  Vector7 velocity() const { return velocity_; }
  bool locked() const { return locked_; }  ///< stands still on its brakes
  /// Ideal torque between motor and link, Nm.
  const Vector7& jointTorque() const { return joint_torque_; }
  /// External torque on the joints, Nm.
  const Vector7& externalTorque() const { return external_torque_; }
  Vector7 acceleration() const { return acceleration_; }  ///< over the last step, rad/s^2
  Pose palm() const { return model_->poseOf(model_->palm_frame); }
  Twist palmTwist() const { return twistOf(model_->palm_frame); }
  /// Dynamic terms of the whole mechanism, for all degrees of freedom.
  struct Terms {
    Eigen::MatrixXd mass;                   ///< with the reflected inertias of motors and gears
    Eigen::VectorXd bias;                   ///< C(q, dq) dq + g(q)
    Eigen::MatrixXd jacobian;               ///< 6 rows x y z rx ry rz of ih2_palm, world axes
    std::vector<int> arm, fingers, object;  ///< their degrees of freedom
  };
  Terms terms() const;
  /// Kinetic and potential energy of everything, J.
  double energy();

  // Object and hands
  Pose object() const { return model_->poseOf(model_->object); }
  Twist objectTwist() const { return twistOf(model_->object); }
  Pose personHand() const { return model_->poseOf(model_->person); }
  /// Closure of the fingers without the thumb, 0 open .. 1 closed: mean joint angle, as share of
  /// the range.
  double handClosure() const;
  const Touch& touch() const { return touch_; }
  const Vector3d& objectForce() const { return object_force_; }  ///< N, object on the robot's hand
  /// Force of all contacts on palm and fingers, N, world axes; contacts between them do not count.
  const Vector3d& touchForce() const { return touch_force_; }
  /// Torque of the same contacts about the origin of ih2_palm, Nm, world axes.
  const Vector3d& touchTorque() const { return touch_torque_; }
  const Wrench& push() const { return push_; }  ///< see setPush()
  /// Force of the object on the person's hand, N, world axes, mean over 20 ms: load of the grip,
  /// minus the force that accelerates the object with the hand. Zero without a grip.
  const Vector3d& personForce() const { return person_force_; }
  double robotShare() const { return robot_share_; }  ///< of the weight, 0..1
  double personShare() const { return person_share_; }
  std::string heldBy() const;  ///< robot, human, both, board, floor, none
  bool dropped() const { return dropped_; }
  bool robotHolds() const { return squeeze_ > kHolds; }
  int contacts() const { return contacts_; }  ///< in the last step

  double time() const { return time_; }
  const PlantConfig& config() const { return config_; }
  Model& model() { return *model_; }

 private:
  static constexpr double kHolds = 0.5;  // N, smallest holding force, also of thumb and palm

  /// Forces between the robot's hand and the object in one step.
  struct Pressing {
    Vector3d on_object = Vector3d::Zero();  ///< N, world axes
    double fingers = 0.0, opposing = 0.0;   ///< N, normal; opposing: thumb and palm
  };

  /// Positions and velocities of everything.
  struct State {
    std::vector<mjtNum> position, velocity;
  };

  Twist twistOf(int body) const;
  void addContact(int body, int other, const Wrench& load, double normal, Pressing& pressing);
  FreeBody freeBody(int body, int velocity) const;
  void put(int position, int velocity, const Pose& pose, const Twist& twist);
  void keepPlaced();
  void applyArm(const Vector7& motor_torque);
  void applyPerson(double dt);
  void updateGrip(const FreeBody& held, const Pose& hand);
  void applyMotors(double dt);
  void readContacts(double dt);
  void readArm(const Vector7& before, double dt);
  Vector7 pushedTorque() const;
  double blockDamping(int dof) const;
  void addPerson(const PersonInput& person);
  State state() const;
  void acceptOrRestore(const State& before, int body, const char* where);
  void resetObject();
  void placeInRobotHand(const Pose& in_palm);
  void closeAround(const Pose& in_palm);
  void refuseOverlap(int body, const char* where) const;
  bool excludeEachOther(int one, int two) const;
  std::string nameOf(int geom) const;
  void check();
  std::string leftOut() const;
  int tooFast();

  PlantConfig config_;
  std::unique_ptr<Model> model_;
  HandMotors motors_;
  PersonInput person_;
  bool person_present_ = false;
  double person_age_ = 0.0;  // s since the last setPerson()
  HoldSpring arm_of_person_, grip_;
  double grip_distance_ = 0.0;  // m, hand to the object's surface when the grip began
  bool grip_lost_ = false;      // the object slid out; the fingers must open first
  Wrench push_;
  bool brakes_ = false, locked_ = false, blocked_ = false;
  bool was_stiff_ = false;  // brakes or block in the last step
  Vector7 position_, velocity_ = Vector7::Zero(), block_position_ = Vector7::Zero();
  Vector7 friction_ = Vector7::Zero(), motor_torque_ = Vector7::Zero();
  Vector7 joint_torque_ = Vector7::Zero(), external_torque_ = Vector7::Zero(),
          acceleration_ = Vector7::Zero();
  Place place_ = Place::World;
  bool placed_ = false;  // kept in place until the person comes or the fingers have closed
  Pose in_hand_;         // pose given to place()
  Touch touch_;
  Vector3d object_force_ = Vector3d::Zero();
  Vector3d touch_force_ = Vector3d::Zero(), touch_torque_ = Vector3d::Zero();  // of all contacts
  double robot_share_ = 0.0, person_share_ = 0.0;
  Vector3d grip_force_ = Vector3d::Zero(), person_force_ = Vector3d::Zero();
  double squeeze_ = 0.0, grasp_force_ = 0.0;  // N, averaged
  bool on_board_ = false, on_floor_ = false, dropped_ = false;
  int contacts_ = 0;
  double time_ = 0.0;
  double reach_ = 0.0, finger_reach_ = 0.0;  // m, bound behind a joint of the arm, of a finger
};

/// Distance of a point of the object's frame from its surface, m, negative inside.
double distanceFrom(const Object& object, const Vector3d& point);

}  // namespace coglab_sim::plant
