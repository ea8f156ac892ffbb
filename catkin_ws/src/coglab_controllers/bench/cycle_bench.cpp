// Times the whole control cycle (steps 1 to 9) with the DMP plug-in against the same cycle on KDL's
// velocity solvers, in interleaved blocks. Prints one JSON object.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <kdl/chain.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainiksolvervel_pinv.hpp>
#include <kdl/chainiksolvervel_wdls.hpp>

#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "coglab_controllers/dmp/library.hpp"
#include "coglab_controllers/manager/controller_manager.hpp"
#include "coglab_controllers/plugins/dmp_controller.hpp"
#include "coglab_rt/joint_limits_table.hpp"

namespace {

using namespace coglab_controllers;

/// D4.10's pipeline with KDL's forward kinematics and one of its velocity solvers in place of ours.
template <typename Solver>
class KdlController : public MotionController {
 public:
  void configure(const MotionSetup& setup) override {
    chain_ = setup.robot->chain.kdl();
    forward_ = std::make_unique<KDL::ChainFkSolverPos_recursive>(chain_);
    inverse_ = std::make_unique<Solver>(chain_);
    Library library;
    library.load(setup.parameters["dmp_file"].as<std::string>());
    plan_.system = TransformationSystem(library.at("reach_human"));
    q_ = KDL::JntArray(7);
    qd_ = KDL::JntArray(7);
  }
  void adopt(const CycleInput&) override {}
  void start(const CycleInput& input) override {
    const ChainState& state = input.chain;
    goal_ = {Vector3(0.80, 0.0, 0.45), state.tool.orientation};
    motion_.start(plan_, state.tool, Vector3::Zero(), Vector3::Zero(), goal_);
  }
  void stop() override {}
  void abort(const Reason&) override {}
  void computeReference(const CycleInput& input, References& references) override {
    goal_.position.y() += 1e-5;
    reference_ = motion_.step(input.dt, goal_, input.time_scale);
    references.states.view<7>(references.pose) << reference_.pose.position,
        reference_.pose.orientation.coeffs();
    references.states.view<6>(references.twist) << reference_.velocity, reference_.angular_velocity;
  }
  void resolve(const CycleInput& input, References& references) override {
    q_.data = input.robot.position;
    KDL::Frame frame;
    forward_->JntToCart(q_, frame);
    const auto& p = reference_.pose.position;
    const auto& o = reference_.pose.orientation;
    const KDL::Frame wanted(KDL::Rotation::Quaternion(o.x(), o.y(), o.z(), o.w()),
                            KDL::Vector(p.x(), p.y(), p.z()));
    const KDL::Twist error = KDL::diff(frame, wanted);
    KDL::Twist twist = 20.0 * error;
    for (int i = 0; i < 3; ++i) {
      twist.vel[i] += reference_.velocity[i];
      twist.rot[i] += reference_.angular_velocity[i];
    }
    inverse_->CartToJnt(q_, twist, qd_);
    references.states.view<kMaxJoints>(references.joint_velocity) = qd_.data;
  }
  MotionState state() const override { return MotionState::Running; }
  const Reason& reason() const override { return reason_; }

 private:
  KDL::Chain chain_;
  std::unique_ptr<KDL::ChainFkSolverPos_recursive> forward_;
  std::unique_ptr<Solver> inverse_;
  KDL::JntArray q_, qd_;
  CartesianMotionPlan plan_;
  CartesianMotion motion_;
  CartesianReference reference_;
  Pose goal_;
  Reason reason_;
};

class Frames : public GoalSource {
 public:
  bool lookup(const std::string&, const std::string&, GoalObservation& goal,
              std::string&) override {
    goal.position = position;
    goal.stamp_ns = goal.frame_ns = now_ns;
    return true;
  }
  Vector3 position{0.80, 0.0, 0.45};
  std::int64_t now_ns = 0;
};

std::string readText(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// One manager with an ideal robot.
struct Bench {
  Bench(const std::string& type, const std::string& package, const std::string& description) {
    const auto table = coglab_rt::loadJointLimits(description + "/config/joint_limits.yaml");
    YAML::Node node;
    node["motion"]["dmp_file"] = package + "/config/primitives.xml";
    ManagerSettings settings =
        readManagerSettings(node, readText(description + "/urdf/lwr_ih2.urdf"), table, true);
    settings.clock = [this] { return frames.now_ns; };
    settings.logger = &logger;
    manager = std::make_unique<ControllerManager>(std::move(settings));
    sample.position << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782;
    sample.commanded_position = sample.position;
    sample.block = coglab_rt::MotionBlock::None;
    tick();
    Answer answer = manager->load("motion", type);
    std::string name;
    if (answer.success) answer = manager->switchTo("motion", name);
    if (!answer.success) throw std::runtime_error(answer.message);
    dmp = dynamic_cast<DmpController*>(manager->motion("motion"));
    if (dmp != nullptr) dmp->setGoalSource(&frames);
  }

  /// Begins a reach from home.
  void begin() {
    sample.position << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782;
    sample.commanded_position = sample.position;
    sample.commanded_velocity.setZero();
    tick();
    if (dmp == nullptr) return;
    DmpRequest request;
    request.primitive_id = "reach_human";
    request.goal_frame = "hand";
    request.orientation_control = true;
    const Answer answer = dmp->execute(request);
    if (!answer.success) throw std::runtime_error(answer.message);
  }

  double tick() {
    frames.now_ns += 5'000'000;
    frames.position.y() += 1e-5;
    ++sample.sequence;
    sample.stamp_ns = frames.now_ns;
    if (dmp != nullptr) dmp->pollGoal();
    const auto begin = std::chrono::steady_clock::now();
    manager->cycle().run(sample, 0.005, command);
    const auto end = std::chrono::steady_clock::now();
    sample.position += 0.005 * command.velocity;
    sample.velocity = command.velocity;
    sample.commanded_velocity = command.velocity;
    sample.commanded_position = sample.position;
    return 1e6 * std::chrono::duration<double>(end - begin).count();
  }

  Frames frames;
  ctrl_more::Logger logger;
  std::unique_ptr<ControllerManager> manager;
  DmpController* dmp = nullptr;
  RobotSample sample;
  VelocityCommand command;
};

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: %s <coglab_controllers folder> <lwr_description folder>\n",
                 argv[0]);
    return 2;
  }
  using Pinv = KdlController<KDL::ChainIkSolverVel_pinv>;
  using Wdls = KdlController<KDL::ChainIkSolverVel_wdls>;
  MotionTypes::instance().insert(
      "bench/Dmp", {[]() -> MotionController* { return new DmpController(); }, nullptr});
  MotionTypes::instance().insert("bench/KdlPinv",
                                 {[]() -> MotionController* { return new Pinv(); }, nullptr});
  MotionTypes::instance().insert("bench/KdlWdls",
                                 {[]() -> MotionController* { return new Wdls(); }, nullptr});
  try {
    Bench ours("bench/Dmp", argv[1], argv[2]);
    Bench pinv("bench/KdlPinv", argv[1], argv[2]);
    Bench wdls("bench/KdlWdls", argv[1], argv[2]);
    std::vector<double> all[3], medians[3], ratio_pinv, ratio_wdls;
    Bench* benches[3] = {&ours, &pinv, &wdls};
    for (int block = 0; block < 150; ++block) {
      for (int which = 0; which < 3; ++which) {
        std::vector<double> times;
        benches[which]->begin();
        for (int i = 0; i < 200; ++i) times.push_back(benches[which]->tick());
        all[which].insert(all[which].end(), times.begin(), times.end());
        medians[which].push_back(median(times));
      }
      ratio_pinv.push_back(medians[1].back() / medians[0].back());
      ratio_wdls.push_back(medians[2].back() / medians[0].back());
    }
    std::printf(
        "{\"ours_us\": %.4f, \"kdl_pinv_us\": %.4f, \"kdl_wdls_us\": %.4f, "
        "\"ratio_pinv\": %.4f, \"ratio_wdls\": %.4f}\n",
        median(all[0]), median(all[1]), median(all[2]), median(ratio_pinv), median(ratio_wdls));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
