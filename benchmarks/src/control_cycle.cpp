/// Times the parts of a control cycle, and the whole cycle (steps 1 to 9) with the DMP plug-in,
/// beside the same on KDL's velocity solvers. Processor time by google-benchmark.
#include <benchmark/benchmark.h>

#include <fstream>
#include <memory>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <kdl/chain.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainiksolvervel_pinv.hpp>
#include <kdl/chainiksolvervel_wdls.hpp>

#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "coglab_controllers/dmp/library.hpp"
#include "coglab_controllers/ik/two_task_ik.hpp"
#include "coglab_controllers/manager/controller_manager.hpp"
#include "coglab_controllers/plugins/dmp_controller.hpp"
#include "coglab_rt/joint_limits_table.hpp"

namespace {

using namespace coglab_controllers;
using Pinv = KDL::ChainIkSolverVel_pinv;
using Wdls = KDL::ChainIkSolverVel_wdls;

constexpr double kGain = 20.0;    // 1/s, of the closed loop
constexpr double kCycle = 0.005;  // s

std::string readText(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

const Library& library() {
  static const Library loaded = [] {
    Library result;
    result.load(PRIMITIVES_FILE);
    return result;
  }();
  return loaded;
}

/// Joint velocities as a user of KDL computes them: pose error, twist, velocity solver.
template <typename Solver>
class KdlInverse {
 public:
  explicit KdlInverse(const KDL::Chain& chain)
      : chain_(chain), forward_(chain_), solver_(chain_), q_(7), velocity_(7) {}

  const KDL::JntArray& solve(const JointVector& q, const CartesianReference& reference) {
    q_.data = q;
    KDL::Frame now;
    forward_.JntToCart(q_, now);
    const Vector3& p = reference.pose.position;
    const Quaternion& o = reference.pose.orientation;
    const KDL::Frame wanted(KDL::Rotation::Quaternion(o.x(), o.y(), o.z(), o.w()),
                            KDL::Vector(p.x(), p.y(), p.z()));
    KDL::Twist twist = kGain * KDL::diff(now, wanted);
    for (int i = 0; i < 3; ++i) {
      twist.vel[i] += reference.velocity[i];
      twist.rot[i] += reference.angular_velocity[i];
    }
    solver_.CartToJnt(q_, twist, velocity_);
    return velocity_;
  }

 private:
  const KDL::Chain chain_;
  KDL::ChainFkSolverPos_recursive forward_;
  Solver solver_;
  KDL::JntArray q_, velocity_;
};

/// D4.10's pipeline with KDL in place of our inverse kinematics.
template <typename Solver>
class KdlController : public MotionController {
 public:
  void configure(const MotionSetup& setup) override {
    inverse_ = std::make_unique<KdlInverse<Solver>>(setup.robot->chain.kdl());
    plan_.dmp = Dmp(library().at("reach_human"));
  }
  void adopt(const CycleInput&) override {}
  void start(const CycleInput& input) override {
    goal_ = {Vector3(0.80, 0.0, 0.45), input.chain.tool.orientation};
    motion_.start(plan_, input.chain.tool, Vector3::Zero(), Vector3::Zero(), goal_);
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
    references.states.view<kMaxJoints>(references.joint_velocity) =
        inverse_->solve(input.robot.position, reference_).data;
  }
  MotionState state() const override { return MotionState::Running; }
  const Reason& reason() const override { return reason_; }

 private:
  std::unique_ptr<KdlInverse<Solver>> inverse_;
  DmpPlan plan_;
  CartesianMotion motion_;
  CartesianReference reference_;
  Pose goal_;
  Reason reason_;
};

/// A goal that moves a little in every cycle.
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

/// One controller manager with an ideal robot.
class Robot {
 public:
  explicit Robot(const std::string& type) {
    YAML::Node node;
    node["motion"]["dmp_file"] = PRIMITIVES_FILE;
    ManagerSettings settings = readManagerSettings(node, readText(URDF_FILE),
                                                   coglab_rt::loadJointLimits(LIMITS_FILE), true);
    settings.clock = [this] { return frames_.now_ns; };
    settings.logger = &logger_;
    manager_ = std::make_unique<ControllerManager>(std::move(settings));
    sample_.block = coglab_rt::MotionBlock::None;
    goHome();
    tick();
    Answer answer = manager_->load("motion", type);
    std::string name;
    if (answer.success) answer = manager_->switchTo("motion", name);
    if (!answer.success) throw std::runtime_error(answer.message);
    dmp_ = dynamic_cast<DmpController*>(manager_->motion("motion"));
    if (dmp_ != nullptr) dmp_->setGoalSource(&frames_);
  }

  /// Begins a reach from home.
  void begin() {
    goHome();
    frames_.position.y() = 0.0;
    tick();
    if (dmp_ == nullptr) return;
    DmpRequest request;
    request.primitive_id = "reach_human";
    request.goal_frame = "hand";
    request.orientation_control = true;
    const Answer answer = dmp_->execute(request);
    if (!answer.success) throw std::runtime_error(answer.message);
  }

  /// One cycle.
  void tick() {
    frames_.now_ns += 5'000'000;
    frames_.position.y() += 1e-5;
    ++sample_.sequence;
    sample_.stamp_ns = frames_.now_ns;
    if (dmp_ != nullptr) dmp_->pollGoal();
    manager_->cycle().run(sample_, kCycle, command_);
    sample_.position += kCycle * command_.velocity;
    sample_.velocity = sample_.commanded_velocity = command_.velocity;
    sample_.commanded_position = sample_.position;
  }

 private:
  void goHome() {
    sample_.position << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782;
    sample_.commanded_position = sample_.position;
    sample_.velocity.setZero();
    sample_.commanded_velocity.setZero();
  }

  Frames frames_;
  ctrl_more::Logger logger_;
  std::unique_ptr<ControllerManager> manager_;
  DmpController* dmp_ = nullptr;
  RobotSample sample_;
  VelocityCommand command_;
};

void wholeCycle(benchmark::State& state, const char* type) {
  Robot robot(type);
  int i = 0;
  for (auto _ : state) {
    if (i++ % 200 == 0) robot.begin();
    robot.tick();
  }
}

/// Random postures, and for each a reference near by.
struct Inputs {
  Chain chain{readText(URDF_FILE), "lwr_base_link", "ih2_palm"};
  std::vector<JointVector> postures;
  std::vector<CartesianReference> references;

  Inputs() {
    std::mt19937 engine(7);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    const auto random = [&] { return Vector3(uniform(engine), uniform(engine), uniform(engine)); };
    for (int i = 0; i < 256; ++i) {
      JointVector q;
      for (int j = 0; j < kMaxJoints; ++j) q[j] = (j % 2 ? 1.8 : 2.6) * uniform(engine);
      CartesianReference reference;
      reference.pose = chain.evaluate(q).tool;
      reference.pose.position += 0.001 * random();
      reference.velocity = 0.3 * random();
      reference.angular_velocity = 0.3 * random();
      postures.push_back(q);
      references.push_back(reference);
    }
  }
};

void dmpStep(benchmark::State& state) {
  const Vector3 goal(0.6, 0.1, 0.4);
  Dmp dmp(library().at("reach_human"));
  int i = 0;
  for (auto _ : state) {
    if (i++ % 240 == 0) dmp.start(Vector3::Zero(), Vector3::Zero(), goal, 1.0);
    benchmark::DoNotOptimize(dmp.step(kCycle, goal).position.x());
  }
}

void twoTaskIk(benchmark::State& state) {
  const Inputs inputs;
  const TwoTaskIk ik;
  ChainState chain;
  IkResult result;
  std::size_t i = 0;
  for (auto _ : state) {
    const JointVector& q = inputs.postures[i % inputs.postures.size()];
    inputs.chain.evaluate(q, chain);
    ik.solve(chain, q, inputs.references[i % inputs.postures.size()], result);
    benchmark::DoNotOptimize(result.velocity[0]);
    ++i;
  }
}

void kdlWdls(benchmark::State& state) {
  const Inputs inputs;
  KdlInverse<Wdls> inverse(inputs.chain.kdl());
  std::size_t i = 0;
  for (auto _ : state) {
    const std::size_t k = i++ % inputs.postures.size();
    benchmark::DoNotOptimize(inverse.solve(inputs.postures[k], inputs.references[k]).data[0]);
  }
}

template <typename Controller>
void offer(const char* type) {
  MotionTypes::instance().insert(type,
                                 {[]() -> MotionController* { return new Controller(); }, nullptr});
}

}  // namespace

int main(int argc, char** argv) {
  offer<DmpController>("bench/Dmp");
  offer<KdlController<Pinv>>("bench/KdlPinv");
  offer<KdlController<Wdls>>("bench/KdlWdls");
  benchmark::RegisterBenchmark("dmp_step", dmpStep);
  benchmark::RegisterBenchmark("two_task_ik", twoTaskIk);
  benchmark::RegisterBenchmark("kdl_wdls", kdlWdls);
  for (const char* name : {"Dmp", "KdlPinv", "KdlWdls"}) {
    const std::string type = std::string("bench/") + name;
    benchmark::RegisterBenchmark((std::string("cycle_") + name).c_str(),
                                 [type](benchmark::State& s) { wholeCycle(s, type.c_str()); });
  }
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
