/// @file
/// What the plant is made of, and the text of the model that MuJoCo compiles from it.
#pragma once

#include <string>

#include "coglab_sim/geometry.hpp"
#include "coglab_sim/plant/hand_table.hpp"

namespace coglab_sim::plant {

/// The object that is handed over. Defaults, units and texts are in parameter_table.inc.
struct Object {
#define OBJECT(type, field, value, ...) type field = value;
#include "coglab_sim/parameter_table.inc"
};

/// @throws std::invalid_argument with object, parameter, value and range.
void checkObject(const Object& object);

/// Diagonal of the inertia of the solid about its middle, kg m^2.
Vector3d inertiaOf(const Object& object);

/// What stands around the robot.
struct Surroundings {
#define SURROUNDINGS(type, field, value, ...) type field = value;
#include "coglab_sim/parameter_table.inc"
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
