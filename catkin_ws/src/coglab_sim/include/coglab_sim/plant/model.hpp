/// @file
/// A compiled MuJoCo model with its state and the indices of the parts that the plant uses.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "coglab_sim/plant/scene_description.hpp"

namespace coglab_sim::plant {

/// Owns mjModel and mjData. The integers below are indices into their arrays.
class Model {
 public:
  /// @throws std::invalid_argument or std::runtime_error with file and reason: an error of
  /// writeModel(), a model that MuJoCo refuses, or a library that does not fit its headers.
  explicit Model(const SceneDescription& scene);

  const mjModel* get() const { return model_.get(); }
  mjModel* get() { return model_.get(); }
  mjData* data() { return data_.get(); }
  const mjData* data() const { return data_.get(); }

  std::array<int, 7> arm_position, arm_velocity;  ///< of the joints in wire order, in qpos and qvel
  int object_position = 0, object_velocity = 0;   ///< first of 7 in qpos, first of 6 in qvel
  int person_position = 0, person_velocity = 0;
  int object = 0, person = 0, palm_frame = 0, palm = 0;  ///< bodies
  int board = -1, floor = -1;                            ///< geoms; board -1: no board
  std::vector<int> phalanges;  ///< bodies, in the order of the hand's table
  std::vector<int> phalanx_position, phalanx_velocity;  ///< of their joints
  std::array<int, kMotors> tendons;

  /// World pose of a body at the last forward computation.
  Pose poseOf(int body) const;
  /// Upper bound (m) of the distance from any joint to the middle of any link or phalanx behind it.
  double reach() const;

 private:
  struct Free {
    void operator()(mjModel* model) const { mj_deleteModel(model); }
    void operator()(mjData* data) const { mj_deleteData(data); }
  };
  int find(mjtObj type, const std::string& name) const;

  std::unique_ptr<mjModel, Free> model_;
  std::unique_ptr<mjData, Free> data_;
};

}  // namespace coglab_sim::plant
