/// @file
/// Pictures of the simulated cell, drawn without a screen or a graphics card.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "coglab_sim/geometry.hpp"

namespace coglab_sim {

/// Colour and opacity, each 0..1.
struct Colour {
  float red = 0.5F, green = 0.5F, blue = 0.5F, opacity = 1.0F;
};

/// An off-screen camera on a MuJoCo model (Plant::model()). It draws with EGL, without a surface,
/// and does not change the model. All calls must come from the thread that created the camera.
class Camera {
 public:
  /// Size of the pictures in pixels. The camera copies the model: after Plant::setObject() create a
  /// new camera.
  /// @throws std::runtime_error if EGL gives no context or no buffer of this size.
  Camera(const mjModel& model, int width, int height);
  ~Camera();
  Camera(const Camera&) = delete;
  Camera& operator=(const Camera&) = delete;

  /// Sets the colour of all solids of a body; the body "world" has all fixed solids.
  /// @throws std::invalid_argument if the model has no such body.
  void setColour(const std::string& body, const Colour& colour);
  /// Looks at a point (m, world) from a distance (m); azimuth and elevation in degrees.
  void look(const Vector3d& at, double distance, double azimuth, double elevation);
  /// Vertical field of view, degrees.
  void setFieldOfView(double angle);
  /// Adds a solid to the next picture only: sphere, capsule, ellipsoid, cylinder or box; `size`
  /// holds half sizes (m), as in MuJoCo.
  /// @throws std::invalid_argument for another shape, or std::length_error beyond kSolids.
  void add(const std::string& shape, const Vector3d& size, const Pose& pose, const Colour& colour);

  /// Draws the state in `data`. Returns three bytes per pixel (red, green, blue), top row first,
  /// valid until the next picture.
  const std::vector<std::uint8_t>& draw(mjData& data);
  /// Distance (m) of each pixel of the last picture from the camera's plane, top row first.
  std::vector<float> depth() const;

  int width() const { return width_; }
  int height() const { return height_; }

  static constexpr int kSolids = 1000;  ///< most solids in one picture, with those of the model

 private:
  struct Context;  // contexts of EGL and MuJoCo

  const int width_, height_;
  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model_;
  std::unique_ptr<Context> context_;
  std::vector<mjvGeom> added_;
  std::vector<std::uint8_t> pixels_, rows_;
  std::vector<float> depth_;
};

}  // namespace coglab_sim
