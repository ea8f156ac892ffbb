/// @file
/// The object of the handover as a rigid body, and everything that can carry it.
///
/// Three couplings: touch of palm and fingers (Hunt-Crossley normal force with regularised Coulomb
/// friction), the robot's grasp, which grows with the finger positions, and the person's grip.
/// Planes (board, floor) carry what nobody holds, so that an early release drops the object.
/// Whatever acts on the object acts back on the palm.
#pragma once

#include <array>
#include <string>

#include "coglab_sim/grip_coupling.hpp"
#include "coglab_sim/shape.hpp"

namespace coglab_sim {

/// The object, from the object database.
struct ObjectParameters {
  std::string id = "mug";
  double mass = 0.31;                          ///< kg, 0.01 .. 10
  std::string shape = "cylinder";              ///< box, cylinder, sphere
  Vector3d size = Vector3d(0.08, 0.08, 0.10);  ///< m along x y z of the object frame
  Vector3d center = Vector3d(
      0.0, 0.0, 0.05);    ///< m, middle of the solid (and centre of mass) in the object frame
  double friction = 0.6;  ///< against hands and planes
  /// Positions 0..254 at which the five motors meet the object; negative: from the object's width.
  std::array<int, 5> finger_contact = {-1, -1, -1, -1, -1};
};

/// Figures of the contact model; all ours.
struct ContactParameters {
  double stiffness = 4e4;            ///< N/m^1.5 per contact point
  double restitution_damping = 1.5;  ///< s/m, Hunt-Crossley
  double slip_speed = 0.01;          ///< m/s over which Coulomb friction builds up
  GripCoupling::Figures human;       ///< 600 N/m, within the 300-800 N/m of the literature
  GripCoupling::Figures robot{1500.0, 5.0, 0.7, 0.03};
  double human_reach =
      0.06;  ///< m between hand frame and the object's surface at which a grip finds it
  double robot_reach = 0.015;  ///< m between the grasp centre and the object's surface
  Vector3d grasp_center = Vector3d(0.035, 0.0, 0.02);  ///< in ih2_palm: where closing fingers meet
  double newton_per_count = 0.5;   ///< N of finger force per position count beyond contact
  double finger_force_max = 15.0;  ///< N per finger
  double full_grasp_force =
      10.0;  ///< N, sum of the fingers at which the grasp has its full stiffness
  double current_per_count = 6.0;  ///< counts of motor current per position count beyond contact
  double floor_height = -0.75;     ///< m, world z
  Vector3d board_center =
      Vector3d(0.45, -0.55, 0.05);  ///< m, middle of the board's upper side in the world
  Vector3d board_size = Vector3d(0.50, 0.40, 0.0);  ///< m along world x y; 0: no board
};

/// What the person's hand does.
struct HumanInput {
  Pose hand;
  Twist twist;
  double grip = 0.0;         ///< 0 open .. 1 full
  double grip_force = 20.0;  ///< N at full grip
};

/// What the robot's fingers do: positions of the five motors 0..254 (thumb abduction, thumb, index,
/// middle, ring+little).
using FingerInput = std::array<int, 5>;

/// Where each finger meets the object; see coglab_msgs/FingerContact.
struct FingerContactState {
  std::array<int, 5> position;      ///< 255: free
  std::array<double, 5> stiffness;  ///< counts of current per position count
};

/// Where an object can be put.
enum class Placement {
  HumanHand,  ///< pose is that of the object in human_hand; follows the hand until its grip holds
  RobotHand,  ///< pose is that of the object in ih2_palm; held still until the fingers hold
  World       ///< pose is that of the object in the world, let go at once
};

class ObjectPhysics {
 public:
  /// @throws std::invalid_argument naming the figure that is out of range.
  ObjectPhysics(const ObjectParameters& object, const ContactParameters& contact);

  /// Puts the object somewhere and lets it go as soon as what holds it there is ready.
  void place(Placement placement, const Pose& pose);

  /// Advances by `dt` s (1 ms). Returns the wrench on the palm about its origin, world axes.
  Wrench step(const Pose& palm, const Twist& palm_twist, const HumanInput& human,
              bool human_present, const FingerInput& fingers, double dt);

  Pose pose() const;                                         ///< of the object frame in the world
  Twist twist() const;                                       ///< of its origin
  const Vector3d& palmForce() const { return palm_force_; }  ///< N on the robot hand, world axes
  double robotShare() const { return robot_share_; }         ///< of the weight, 0..1
  double humanShare() const { return human_share_; }
  std::string heldBy() const;  ///< robot, human, both, board, floor, none
  bool dropped() const { return dropped_; }
  bool robotGrasps() const { return robot_grip_.engaged(); }
  bool humanGrasps() const { return human_grip_.engaged(); }
  bool slipping() const { return robot_grip_.slipping() || human_grip_.slipping(); }
  /// For the hand: where the fingers meet the object if it lies in the grasp; 255 for those that
  /// were folded before it came.
  FingerContactState fingerContact(const Pose& palm) const;
  const ObjectParameters& object() const { return object_; }
  const ContactParameters& contact() const { return contact_; }

 private:
  bool inGrasp(const Pose& palm) const;
  void watchFingers(const Pose& palm, const FingerInput& fingers);
  double fingerForce(const FingerInput& fingers) const;
  /// Adds the force of one contact point; returns it.
  Vector3d touch(const Vector3d& point, const Vector3d& normal, double depth,
                 const Vector3d& other_speed, int points, Wrench& wrench) const;
  Wrench planes();
  Wrench palmTouch(const Pose& palm, const Twist& palm_twist, const FingerInput& fingers,
                   Wrench& reaction) const;
  void pin(const Pose& hand, const Twist& twist);

  ObjectParameters object_;
  ContactParameters contact_;
  Shape shape_;
  Vector3d inertia_;
  std::array<int, 5> finger_contact_;
  std::array<bool, 5>
      folded_{};  // was closed before the object came: it lies behind it and presses nothing
  GripCoupling human_grip_, robot_grip_;
  Pose center_;  // of mass, in the world
  Twist speed_;
  Placement placement_ = Placement::World;
  Pose placed_;  // the object in whatever holds it
  bool pinned_ = false;
  bool dropped_ = false, on_board_ = false, on_floor_ = false;
  double robot_share_ = 0.0, human_share_ = 0.0;
  Vector3d palm_force_ = Vector3d::Zero();
};

}  // namespace coglab_sim
