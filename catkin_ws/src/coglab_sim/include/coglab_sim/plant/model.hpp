/// @file
/// A compiled model of MuJoCo with its state, and the numbers of what the plant asks for by name.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "coglab_sim/plant/scene_description.hpp"

namespace coglab_sim::plant {

/// Owns mjModel and mjData; the numbers below are indices into their arrays.
class Model {
 public:
  /// @throws std::invalid_argument or std::runtime_error with file and reason: what writeModel()
  /// finds, what MuJoCo refuses, or a library that does not fit its headers.
  explicit Model(const SceneDescription& scene);

  const mjModel* get() const { return model_.get(); }
  mjModel* get() { return model_.get(); }
  mjData* data() { return data_.get(); }
  const mjData* data() const { return data_.get(); }

  std::array<int, 7> arm_position, arm_velocity;  ///< of the joints in wire order, in qpos and qvel
  int object_position = 0, object_velocity = 0;   ///< first of 7 and of 6
  int person_position = 0, person_velocity = 0;
  int object = 0, person = 0, palm_frame = 0, palm = 0;  ///< bodies
  int board = -1, floor = -1;                            ///< geoms; board -1: there is none
  std::vector<int> phalanges;  ///< bodies, in the order of the hand's table
  std::vector<int> phalanx_position, phalanx_velocity;  ///< of their joints
  std::array<int, kMotors> tendons;

  /// Pose of a body in the world as of the last forward computation.
  Pose poseOf(int body) const;
  /// m that the middle of no link or phalanx can be away from any joint before it.
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
