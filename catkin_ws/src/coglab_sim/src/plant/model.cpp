#include "coglab_sim/plant/model.hpp"

#include <algorithm>
#include <clocale>
#include <cstring>
#include <stdexcept>

namespace coglab_sim::plant {
namespace {

[[noreturn]] void throwError(const char* text) {
  throw std::runtime_error(std::string("MuJoCo: ") + text);
}
void dropWarning(const char*) {}  // the plant reads warnings from mjData

/// While this object exists, the thread reads and writes numbers with a decimal point (as in URDF
/// and MJCF), even if the locale of the program has decimal commas.
class DecimalPoint {
 public:
  DecimalPoint() : made_(newlocale(LC_ALL_MASK, "C", nullptr)), before_(uselocale(made_)) {}
  ~DecimalPoint() {
    uselocale(before_);
    freelocale(made_);
  }
  DecimalPoint(const DecimalPoint&) = delete;
  DecimalPoint& operator=(const DecimalPoint&) = delete;

 private:
  locale_t made_, before_;
};

void checkLibrary() {
  // By default MuJoCo ends the process on an error and writes a file on a warning.
  mju_user_error = [](const char* text) { throwError(text); };
  mju_user_warning = dropWarning;
  if (mj_version() != mjVERSION_HEADER)
    throw std::runtime_error("the library libmujoco is version " + std::string(mj_versionString()) +
                             ", built against " + std::to_string(mjVERSION_HEADER) +
                             "; install Debian's libmujoco-dev and build again");
}

mjModel* compile(const std::string& text, const std::string& urdf) {
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  constexpr const char* kName = "cell.xml";
  if (mj_makeEmptyFileVFS(files.get(), kName, static_cast<int>(text.size())) != 0)
    throw std::runtime_error("MuJoCo does not take the model's text");
  std::memcpy(files->filedata[0], text.data(), text.size());
  std::array<char, 1000> error{};
  mjModel* model = mj_loadXML(kName, files.get(), error.data(), static_cast<int>(error.size()));
  mj_deleteVFS(files.get());
  if (model == nullptr)
    throw std::runtime_error("MuJoCo refuses the robot description " + urdf +
                             " with its hand and object: " + error.data());
  return model;
}

}  // namespace

Model::Model(const SceneDescription& scene) {
  checkLibrary();
  const DecimalPoint numbers;
  model_.reset(compile(writeModel(scene), scene.urdf));
  data_.reset(mj_makeData(model_.get()));
  if (!data_) throw std::runtime_error("MuJoCo has no memory for the model's state");

  const auto joints = armJoints(scene.urdf, scene.hand.palm);
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const int joint = find(mjOBJ_JOINT, joints[i]);
    arm_position[i] = model_->jnt_qposadr[joint];
    arm_velocity[i] = model_->jnt_dofadr[joint];
  }
  for (const Phalanx& phalanx : scene.hand.phalanges) {
    const int joint = find(mjOBJ_JOINT, phalanx.name);
    phalanges.push_back(find(mjOBJ_BODY, phalanx.name));
    phalanx_position.push_back(model_->jnt_qposadr[joint]);
    phalanx_velocity.push_back(model_->jnt_dofadr[joint]);
  }
  for (std::size_t i = 0; i < tendons.size(); ++i)
    tendons[i] = find(mjOBJ_TENDON, scene.hand.motors[i].name);
  object = find(mjOBJ_BODY, kObjectBody);
  person = find(mjOBJ_BODY, kPersonBody);
  palm_frame = find(mjOBJ_BODY, kPalmFrame);
  palm = find(mjOBJ_BODY, scene.hand.palm);
  floor = find(mjOBJ_GEOM, "floor");
  board = mj_name2id(model_.get(), mjOBJ_GEOM, "board");
  for (const auto& [body, position, velocity] :
       {std::tuple{object, &object_position, &object_velocity},
        std::tuple{person, &person_position, &person_velocity}}) {
    *position = model_->jnt_qposadr[model_->body_jntadr[body]];
    *velocity = model_->jnt_dofadr[model_->body_jntadr[body]];
  }
}

int Model::find(mjtObj type, const std::string& name) const {
  const int id = mj_name2id(model_.get(), type, name.c_str());
  if (id < 0) throw std::runtime_error("the model of the cell has no '" + name + "'");
  return id;
}

double Model::reach() const {
  double farthest = 0.0;
  for (int body = 1; body < model_->nbody; ++body) {
    if (model_->body_rootid[body] != model_->body_rootid[palm]) continue;
    double way = Eigen::Map<const Vector3d>(model_->body_ipos + 3 * body).norm();
    for (int link = body; link != 0; link = model_->body_parentid[link])
      way += Eigen::Map<const Vector3d>(model_->body_pos + 3 * link).norm();
    farthest = std::max(farthest, way);
  }
  return farthest;
}

Pose Model::poseOf(int body) const {
  const mjtNum* p = data_->xpos + 3 * body;
  const mjtNum* q = data_->xquat + 4 * body;
  return {Vector3d(p[0], p[1], p[2]), Quaterniond(q[0], q[1], q[2], q[3])};
}

}  // namespace coglab_sim::plant
