/// @file
/// What the plant is made of, and the text of the model that MuJoCo compiles from it.
#pragma once

#include <string>

#include "coglab_sim/geometry.hpp"
#include "coglab_sim/plant/hand_table.hpp"

namespace coglab_sim::plant {

/// The object that is handed over, from the object database. What stands here is that of
/// coglab_objects/objects/mug.yaml, for programs that have no database; a test compares.
struct Object {
  std::string id = "mug";
  double mass = 0.31;                          ///< kg, 0.01 .. 10
  std::string shape = "cylinder";              ///< box, cylinder (axis z) or sphere
  Vector3d size = Vector3d(0.08, 0.08, 0.10);  ///< m along x y z of the object frame, 0.001 .. 2
  /// m, middle of the solid and centre of mass in the object frame.
  Vector3d center = Vector3d(0.0, 0.0, 0.05);
  double friction = 0.6;  ///< sliding, against everything, 0 .. 2
};

/// @throws std::invalid_argument with object, figure, its range and its value.
void checkObject(const Object& object);

/// Diagonal of the inertia of the solid about its middle, kg m^2.
Vector3d inertiaOf(const Object& object);

/// What stands around the robot.
struct Surroundings {
  double floor_height = -0.75;                      ///< m, world z
  Vector3d board_center{0.45, -0.55, 0.05};         ///< m, middle of the board's upper side
  Vector3d board_size = Vector3d(0.50, 0.40, 0.0);  ///< m along world x y; 0: no board
};

/// Everything that the model is made of.
struct SceneDescription {
  std::string urdf;  ///< path of the robot description
  HandTable hand = builtInHandTable();
  Object object;
  Surroundings surroundings;
  Vector7 rotor_inertia = Vector7::Zero();  ///< kg m^2, reflected to the joints of the arm
};

/// Names of bodies and joints that the model has besides those of the robot description.
constexpr const char* kObjectBody = "object";
constexpr const char* kPersonBody = "person_hand";
constexpr const char* kPalmFrame = "ih2_palm";
constexpr double kPersonMass = 0.5;  ///< kg of the person's hand; ours

/// The model in MJCF: the arm from the robot description with all its digits, the hand from its
/// table in the place of the description's fingers, object, person's hand, board and floor.
/// @throws std::invalid_argument or std::runtime_error naming the file and what is wrong in it.
std::string writeModel(const SceneDescription& scene);

/// Joints of the arm in wire order, from the robot description: the movable ones from
/// lwr_base_link to the palm.
std::array<std::string, 7> armJoints(const std::string& urdf, const std::string& palm_link);

}  // namespace coglab_sim::plant
