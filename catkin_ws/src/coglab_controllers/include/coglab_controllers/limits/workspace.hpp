/// @file
/// Limits of the hand position: inside a box, outside a sphere around the base, arm never fully
/// stretched (D4.10 section 3.1).
#pragma once

#include <array>

#include "coglab_controllers/kinematics/chain.hpp"

namespace coglab_controllers {

/// Workspace restrictions, in the base frame.
struct WorkspaceParameters {
  Vector3 box_min = Vector3(-1.2, -1.2, 0.0);    ///< m: the hand stays inside this box,
  Vector3 box_max = Vector3(1.2, 1.2, 1.6);      ///< m
  Vector3 base_centre = Vector3(0.0, 0.0, 0.2);  ///< m: outside this sphere around the base,
  double base_radius = 0.25;                     ///< m; 0: no sphere
  double max_stretch =
      0.98;  ///< shoulder to wrist at most this share of the chain's reach; 1: no restriction
};

/// Kind of restriction.
enum class WorkspaceBorder { None, BoxMin, BoxMax, BaseSphere, Stretch };
const char* describe(WorkspaceBorder border) noexcept;

/// Distances to the borders and projection of goals. No allocation, no throw after construction.
class Workspace {
 public:
  static constexpr int kBorders = 8;

  /// A border as seen from one configuration.
  struct Margin {
    double distance = 0.0;  ///< m to the border, negative outside
    double rate = 0.0;      ///< m/s at which the distance grows with the given joint velocity
    WorkspaceBorder border = WorkspaceBorder::None;
  };

  /// @throws std::invalid_argument naming the parameter that is not finite, or a box or sphere that
  /// leaves no room.
  Workspace(const WorkspaceParameters& parameters, double reach);
  explicit Workspace(const WorkspaceParameters& parameters = {}) : Workspace(parameters, 0.0) {}

  /// All borders for a configuration and a joint velocity.
  void margins(const Chain& chain, const ChainState& state, const JointVector& velocity,
               std::array<Margin, kBorders>& margins) const noexcept;

  /// Checks a hand position (m) without the stretch of the arm. Returns the first violated
  /// border.
  WorkspaceBorder violated(const Vector3& point) const noexcept;
  bool contains(const Vector3& point) const noexcept {
    return violated(point) == WorkspaceBorder::None;
  }

  /// The nearest allowed point: into the box, out of the sphere. For goals outside the workspace.
  Vector3 project(const Vector3& point) const noexcept;

  const WorkspaceParameters& parameters() const noexcept { return parameters_; }

 private:
  WorkspaceParameters parameters_;
  double max_distance_ = 0.0;  // shoulder to wrist, m; 0: no restriction
};

}  // namespace coglab_controllers
