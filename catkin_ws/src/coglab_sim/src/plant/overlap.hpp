/// @file
/// How deep solids of a model stand in each other, for poses that are to be refused.
#pragma once

#include <functional>

#include <mujoco/mujoco.h>

namespace coglab_sim::plant {

/// Two geoms and how deep (m) one stands in the other; depth 0: none does.
struct Overlap {
  int one = -1, two = -1;
  double depth = 0.0;
};

/// The deepest overlap of two geoms of different bodies that `counts` accepts. The contacts have to
/// be those of the state as it is (mj_step1).
///
/// Contacts alone miss one solid deep inside another: where their middles coincide MuJoCo finds no
/// direction that parts them, and some pairs do not collide at all. So balls inside the one are
/// held against the other besides; that depth is a lower bound, so that nothing is refused by
/// mistake.
Overlap deepestOverlap(const mjModel* m, const mjData* d,
                       const std::function<bool(int one, int two)>& counts);

}  // namespace coglab_sim::plant
