#include "coglab_controllers/limits/workspace.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace coglab_controllers {

const char* describe(WorkspaceBorder border) noexcept {
  switch (border) {
    case WorkspaceBorder::None:
      return "inside the workspace";
    case WorkspaceBorder::BoxMin:
      return "lower side of the workspace box";
    case WorkspaceBorder::BoxMax:
      return "upper side of the workspace box";
    case WorkspaceBorder::BaseSphere:
      return "sphere around the base";
    case WorkspaceBorder::Stretch:
      return "arm fully stretched";
  }
  return "unknown";
}

Workspace::Workspace(const WorkspaceParameters& parameters, double reach)
    : parameters_(parameters) {
  const WorkspaceParameters& p = parameters_;
  if (!p.box_min.allFinite() || !p.box_max.allFinite() || !(p.box_max - p.box_min).minCoeff() ||
      (p.box_max - p.box_min).minCoeff() <= 0.0) {
    throw std::invalid_argument("workspace box: expected box_max above box_min on each axis, in m");
  }
  if (!p.base_centre.allFinite() || !(p.base_radius >= 0.0 && p.base_radius < 10.0)) {
    throw std::invalid_argument(
        "workspace base sphere: expected a finite centre and a radius from 0 to 10 m, got " +
        std::to_string(p.base_radius));
  }
  if (!(p.max_stretch >= 0.2 && p.max_stretch <= 1.0)) {
    throw std::invalid_argument("max_stretch: expected a share from 0.2 to 1, got " +
                                std::to_string(p.max_stretch));
  }
  bool room = false;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3 point(corner & 1 ? p.box_max.x() : p.box_min.x(),
                        corner & 2 ? p.box_max.y() : p.box_min.y(),
                        corner & 4 ? p.box_max.z() : p.box_min.z());
    room = room || (point - p.base_centre).norm() > p.base_radius;
  }
  if (!room)
    throw std::invalid_argument("workspace: the sphere around the base leaves no room in the box");
  max_distance_ = p.max_stretch < 1.0 ? p.max_stretch * reach : 0.0;
}

void Workspace::margins(const Chain& chain, const ChainState& state, const JointVector& velocity,
                        std::array<Margin, kBorders>& margins) const noexcept {
  const Vector3& hand = state.tool.position;
  const Vector3 hand_velocity = state.jacobian.topRows<3>() * velocity;
  for (int axis = 0; axis < 3; ++axis) {
    margins[2 * axis] = {hand[axis] - parameters_.box_min[axis], hand_velocity[axis],
                         WorkspaceBorder::BoxMin};
    margins[2 * axis + 1] = {parameters_.box_max[axis] - hand[axis], -hand_velocity[axis],
                             WorkspaceBorder::BoxMax};
  }
  margins[6] = margins[7] = {1e3, 0.0, WorkspaceBorder::None};
  if (parameters_.base_radius > 0.0) {
    const Vector3 out = hand - parameters_.base_centre;
    const double distance = out.norm();
    const double rate = distance > 1e-9 ? out.dot(hand_velocity) / distance : 0.0;
    margins[6] = {distance - parameters_.base_radius, rate, WorkspaceBorder::BaseSphere};
  }
  if (max_distance_ > 0.0) {
    const int wrist = chain.wristJoint();
    const Vector3 arm = state.origins.col(wrist) - state.origins.col(1);
    const Vector3 relative =
        Chain::originVelocity(state, wrist, velocity) - Chain::originVelocity(state, 1, velocity);
    const double distance = arm.norm();
    const double rate = distance > 1e-9 ? -arm.dot(relative) / distance : 0.0;
    margins[7] = {max_distance_ - distance, rate, WorkspaceBorder::Stretch};
  }
}

WorkspaceBorder Workspace::violated(const Vector3& point) const noexcept {
  if (!((point - parameters_.box_min).minCoeff() >= 0.0)) return WorkspaceBorder::BoxMin;
  if (!((parameters_.box_max - point).minCoeff() >= 0.0)) return WorkspaceBorder::BoxMax;
  if ((point - parameters_.base_centre).norm() < parameters_.base_radius)
    return WorkspaceBorder::BaseSphere;
  return WorkspaceBorder::None;
}

Vector3 Workspace::project(const Vector3& point) const noexcept {
  const auto into_box = [&](const Vector3& p) -> Vector3 {
    return p.cwiseMax(parameters_.box_min).cwiseMin(parameters_.box_max);
  };
  Vector3 result = into_box(point);
  const Vector3& centre = parameters_.base_centre;
  const double radius = parameters_.base_radius;
  if ((result - centre).norm() >= radius) return result;
  // Out of the sphere. If that leaves the box, then along its border and out of the sphere again.
  Vector3 out = result - centre;
  if (out.norm() < 1e-9) out = Vector3::UnitX();
  for (int i = 0; i < 20; ++i) {
    result = into_box(centre + out * (radius * (1.0 + 1e-9) / out.norm()));
    if ((result - centre).norm() >= radius) return result;
    out = result - centre;
    // A corner inside the sphere: leave along the roomiest axis.
    if (out.norm() < 1e-9) out = Vector3::UnitX();
  }
  Vector3 best = result;
  double best_distance = -1.0;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {parameters_.box_min[axis], parameters_.box_max[axis]}) {
      Vector3 candidate = result;
      const double room = std::abs(side - centre[axis]);
      candidate[axis] =
          room > radius ? centre[axis] + std::copysign(radius * (1.0 + 1e-9), side - centre[axis])
                        : side;
      const double distance = (candidate - centre).norm();
      if (distance < radius) continue;
      if (best_distance < 0.0 || (candidate - result).norm() < best_distance) {
        best = candidate;
        best_distance = (candidate - result).norm();
      }
    }
  }
  return best;
}

}  // namespace coglab_controllers
