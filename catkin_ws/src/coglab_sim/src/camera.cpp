#include "coglab_sim/camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <stdexcept>

#include <EGL/egl.h>

namespace coglab_sim {
namespace {

constexpr std::array<std::uint8_t, 3> kBackground{232, 238, 244};  // colour without objects
constexpr double kLit = 2.0;  // m, radius with shadows around the view's middle

[[noreturn]] void fail(const std::string& what) {
  throw std::runtime_error("no picture without a screen: " + what +
                           "; Debian's libgl1-mesa-dri draws in software: ./coglab install film");
}

mjtGeom shapeOf(const std::string& name) {
  if (name == "sphere") return mjGEOM_SPHERE;
  if (name == "capsule") return mjGEOM_CAPSULE;
  if (name == "ellipsoid") return mjGEOM_ELLIPSOID;
  if (name == "cylinder") return mjGEOM_CYLINDER;
  if (name == "box") return mjGEOM_BOX;
  throw std::invalid_argument("cannot draw the shape '" + name +
                              "'; expected sphere, capsule, ellipsoid, cylinder or box");
}

/// A light above and behind the camera, with shadows.
mjvLight lampOf(const mjvCamera& camera) {
  const double azimuth = camera.azimuth * M_PI / 180.0;
  const Vector3d ahead(std::cos(azimuth), std::sin(azimuth), 0.0);
  const Vector3d right(ahead.y(), -ahead.x(), 0.0);
  const Vector3d along = (0.45 * ahead + 0.18 * right - 0.87 * Vector3d::UnitZ()).normalized();
  const Vector3d from = Eigen::Map<const Vector3d>(camera.lookat) - 3.0 * along;
  mjvLight light{};
  light.directional = 1;
  light.castshadow = 1;
  for (int i = 0; i < 3; ++i) {
    light.pos[i] = static_cast<float>(from[i]);
    light.dir[i] = static_cast<float>(along[i]);
    light.diffuse[i] = 0.55F;
    light.specular[i] = 0.15F;
  }
  light.attenuation[0] = 1.0F;
  light.cutoff = 60.0F;
  return light;
}

}  // namespace

/// An EGL context, current in this thread, with MuJoCo's scene and renderer.
struct Camera::Context {
  explicit Context(const mjModel& model) {
    setenv("EGL_PLATFORM", "surfaceless", 0);
    display = eglGetDisplay(EGL_DEFAULT_DISPLAY);
    if (display == EGL_NO_DISPLAY || eglInitialize(display, nullptr, nullptr) != EGL_TRUE)
      fail("EGL has no display of the platform surfaceless");
    if (eglBindAPI(EGL_OPENGL_API) != EGL_TRUE) fail("EGL has no OpenGL");
    egl = eglCreateContext(display, nullptr, EGL_NO_CONTEXT, nullptr);  // without a configuration
    if (egl == EGL_NO_CONTEXT) fail("EGL gives no context");
    makeCurrent();
    mjv_defaultScene(&scene);
    mjv_defaultCamera(&camera);
    mjv_defaultOption(&option);
    mjr_defaultContext(&renderer);
    mjv_makeScene(&model, &scene, kSolids);
    mjr_makeContext(&model, &renderer, mjFONTSCALE_100);
    mjr_setBuffer(mjFB_OFFSCREEN, &renderer);
    if (renderer.currentBuffer != mjFB_OFFSCREEN) fail("OpenGL has no off-screen buffer");
  }
  ~Context() {
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, egl);
    mjr_freeContext(&renderer);
    mjv_freeScene(&scene);
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display, egl);  // all cameras of the process share the display
  }
  /// Call before each use, because other cameras of this thread have other contexts.
  void makeCurrent() const {
    if (eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, egl) != EGL_TRUE)
      fail("EGL gives no context without a surface");
  }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext egl = EGL_NO_CONTEXT;
  mjvScene scene{};
  mjvCamera camera{};
  mjvOption option{};
  mjrContext renderer{};
};

Camera::Camera(const mjModel& model, int width, int height)
    : width_(width), height_(height), model_(mj_copyModel(nullptr, &model), &mj_deleteModel) {
  if (width < 1 || height < 1 || width > 4096 || height > 4096)
    throw std::runtime_error("a picture has 1 .. 4096 pixels each way, not " +
                             std::to_string(width) + " x " + std::to_string(height));
  model_->vis.global.offwidth = width;
  model_->vis.global.offheight = height;
  model_->vis.quality.shadowsize = 4096;
  model_->vis.map.shadowclip = static_cast<float>(kLit / model_->stat.extent);
  model_->vis.quality.offsamples = 4;
  std::fill_n(model_->vis.headlight.ambient, 3, 0.35F);
  std::fill_n(model_->vis.headlight.diffuse, 3, 0.3F);
  std::fill_n(model_->vis.headlight.specular, 3, 0.0F);
  context_ = std::make_unique<Context>(*model_);
  context_->camera.type = mjCAMERA_FREE;
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  rows_.resize(3 * pixels);
  pixels_.resize(3 * pixels);
  depth_.resize(pixels);
}

Camera::~Camera() = default;

void Camera::setColour(const std::string& body, const Colour& colour) {
  const int id = mj_name2id(model_.get(), mjOBJ_BODY, body.c_str());
  if (id < 0) throw std::invalid_argument("the model has no body '" + body + "' to colour");
  for (int geom = 0; geom < model_->ngeom; ++geom) {
    if (model_->geom_bodyid[geom] != id) continue;
    float* rgba = model_->geom_rgba + 4 * geom;
    rgba[0] = colour.red;
    rgba[1] = colour.green;
    rgba[2] = colour.blue;
    rgba[3] = colour.opacity;
  }
}

void Camera::look(const Vector3d& at, double distance, double azimuth, double elevation) {
  std::copy_n(at.data(), 3, context_->camera.lookat);
  context_->camera.distance = distance;
  context_->camera.azimuth = azimuth;
  context_->camera.elevation = elevation;
}

void Camera::setFieldOfView(double angle) { model_->vis.global.fovy = static_cast<float>(angle); }

void Camera::add(const std::string& shape, const Vector3d& size, const Pose& pose,
                 const Colour& colour) {
  if (static_cast<int>(added_.size()) + model_->ngeom >= kSolids)
    throw std::length_error("a picture has at most " + std::to_string(kSolids) + " solids");
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> turn = pose.rotation.toRotationMatrix();
  const std::array rgba{colour.red, colour.green, colour.blue, colour.opacity};
  added_.emplace_back();
  mjv_initGeom(&added_.back(), shapeOf(shape), size.data(), pose.position.data(), turn.data(),
               rgba.data());
}

const std::vector<std::uint8_t>& Camera::draw(mjData& data) {
  context_->makeCurrent();
  mjvScene& scene = context_->scene;
  mjv_updateScene(model_.get(), &data, &context_->option, nullptr, &context_->camera, mjCAT_ALL,
                  &scene);
  for (const mjvGeom& geom : added_) {
    if (scene.ngeom < scene.maxgeom) scene.geoms[scene.ngeom++] = geom;
  }
  added_.clear();
  scene.lights[scene.nlight++] = lampOf(context_->camera);
  const mjrRect whole{0, 0, width_, height_};
  mjr_render(whole, &scene, &context_->renderer);
  mjr_readPixels(rows_.data(), depth_.data(), whole, &context_->renderer);
  for (std::size_t pixel = 0; pixel < depth_.size(); ++pixel) {
    if (depth_[pixel] >= 1.0F) std::copy_n(kBackground.begin(), 3, rows_.begin() + 3 * pixel);
  }
  const auto row = static_cast<std::ptrdiff_t>(3 * width_);
  for (std::ptrdiff_t y = 0; y < height_; ++y)  // OpenGL stores the bottom row first
    std::copy_n(rows_.begin() + y * row, row, pixels_.begin() + (height_ - 1 - y) * row);
  return pixels_;
}

std::vector<float> Camera::depth() const {
  const float extent = static_cast<float>(model_->stat.extent);
  const float near = model_->vis.map.znear * extent, far = model_->vis.map.zfar * extent;
  std::vector<float> metres(depth_.size());
  for (std::ptrdiff_t y = 0; y < height_; ++y) {
    for (std::ptrdiff_t x = 0; x < width_; ++x) {
      const float value = depth_[static_cast<std::size_t>(y * width_ + x)];
      metres[static_cast<std::size_t>((height_ - 1 - y) * width_ + x)] =
          near / (1.0F - value * (1.0F - near / far));
    }
  }
  return metres;
}

}  // namespace coglab_sim
