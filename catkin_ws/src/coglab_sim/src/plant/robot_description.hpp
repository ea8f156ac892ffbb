/// @file
/// Links and joints of a URDF that the plant needs.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "coglab_sim/geometry.hpp"

namespace coglab_sim::plant {

struct Solid {
  std::string kind;  ///< box, cylinder, sphere
  Vector3d size;     ///< m: half extents; radius, half length; radius
  Pose pose;         ///< in its link
};

struct Link {
  std::string name;
  bool has_inertia = false;
  double mass = 0.0;
  Pose inertia_frame;
  Matrix3d inertia = Matrix3d::Zero();  ///< in that frame, about the centre of mass
  std::vector<Solid> collisions;
};

struct Joint {
  std::string name, type, parent, child;
  Pose origin;
  Vector3d axis = Vector3d::UnitX();
  double lower = 0.0, upper = 0.0, damping = 0.0;
  bool moves() const { return type != "fixed"; }
  bool limited() const { return type == "revolute" || type == "prismatic"; }
};

/// Mass and first moment (kg m) of a part of the tree, in the frame of its first link.
struct MassMoment {
  double mass = 0.0;
  Vector3d moment = Vector3d::Zero();
};

/// A robot description as a tree.
struct RobotDescription {
  std::string path, root;
  std::map<std::string, Link> links;
  std::vector<Joint> joints;  ///< in the order of the file

  std::vector<const Joint*> below(const std::string& link) const;
  /// Moments of a link with all links on its movable joints, with these at zero.
  MassMoment withMovableLinks(const std::string& link) const;
  /// Movable joints from the root to a link. @throws std::runtime_error if there is no such link.
  std::vector<const Joint*> chainTo(const std::string& link) const;
};

/// @throws std::runtime_error naming file and element.
RobotDescription readRobotDescription(const std::string& path);

}  // namespace coglab_sim::plant
