/// @file
/// Parts of the plant, and the MJCF text that MuJoCo compiles into a model.
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

/// Diagonal of the solid's inertia about its middle, kg m^2.
Vector3d inertiaOf(const Object& object);

/// Fixed things around the robot.
struct Surroundings {
#define SURROUNDINGS(type, field, value, ...) type field = value;
#include "coglab_sim/parameter_table.inc"
};

/// All parts of the model.
struct SceneDescription {
  std::string urdf;  ///< path of the robot description
  HandTable hand = builtInHandTable();
  Object object;
  Surroundings surroundings;
  Vector7 rotor_inertia = Vector7::Zero();  ///< kg m^2, reflected to the joints of the arm
};

/// Names of the model's bodies and joints that are not in the robot description.
constexpr const char* kObjectBody = "object";
constexpr const char* kPersonBody = "person_hand";
constexpr const char* kPalmFrame = "ih2_palm";
constexpr double kPersonMass = 0.5;  ///< kg of the person's hand; ours

/// Returns the model in MJCF: arm, hand, object, person's hand, board and floor. The arm comes from
/// the robot description, in full precision. The hand's table replaces the fingers of the
/// description.
/// @throws std::invalid_argument or std::runtime_error naming the file and the error.
std::string writeModel(const SceneDescription& scene);

/// Names of the arm's joints in wire order: the movable joints of the robot description from
/// lwr_base_link to the palm.
std::array<std::string, 7> armJoints(const std::string& urdf, const std::string& palm_link);

}  // namespace coglab_sim::plant
