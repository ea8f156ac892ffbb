/// @file
/// Overlap of solids in a model, to refuse such poses.
#pragma once

#include <functional>

#include <mujoco/mujoco.h>

namespace coglab_sim::plant {

/// Two geoms and the depth (m) of their overlap; 0: none.
struct Overlap {
  int one = -1, two = -1;
  double depth = 0.0;
};

/// The deepest overlap of two geoms of different bodies that `counts` accepts. The contacts must be
/// up to date (mj_step1).
///
/// Contacts alone miss one solid deep inside another: if their middles coincide, MuJoCo finds no
/// separating direction, and some pairs never collide. Therefore balls inside one solid are also
/// tested against the other. This depth is a lower bound, so that no valid pose is refused.
Overlap deepestOverlap(const mjModel* m, const mjData* d,
                       const std::function<bool(int one, int two)>& counts);

}  // namespace coglab_sim::plant
