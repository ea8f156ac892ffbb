// Times the parts of a control cycle beside KDL's velocity solvers, for bench_dmp.py and
// bench_ik.py. Prints one JSON object: microseconds of processor time per call by name, medians
// over blocks that alternate between all candidates, and the cycle's share of each KDL cycle as the
// median of the blocks' ratios.
#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <iostream>
#include <random>
#include <sstream>
#include <vector>

#include <kdl/chain.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainiksolvervel_pinv.hpp>
#include <kdl/chainiksolvervel_wdls.hpp>
#include <kdl/chainjnttojacsolver.hpp>

#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "coglab_controllers/dmp/library.hpp"
#include "coglab_controllers/ik/two_task_ik.hpp"
#include "coglab_controllers/limits/guard.hpp"

using namespace coglab_controllers;

namespace {

constexpr int kPostures = 256, kBlocks = 401, kCallsPerBlock = 240;

// Processor time of this thread, us: what other processes do does not count.
double now() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e6 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_nsec);
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

struct Candidate {
  std::string name;
  std::function<double(int)> call;  // returns something that depends on the result
  std::vector<double> times;
};

// The cycle as a user of KDL writes it: pose error, twist, velocity solver, scaling of the whole
// vector.
template <typename Solver>
JointVector kdlCycle(KDL::ChainFkSolverPos_recursive& fk, Solver& solver, const JointVector& q,
                     const CartesianReference& reference, const JointVector& limit) {
  thread_local KDL::JntArray joints(kMaxJoints), velocity(kMaxJoints);
  joints.data = q;
  KDL::Frame now;
  fk.JntToCart(joints, now);
  const Vector3& p = reference.pose.position;
  const Quaternion& o = reference.pose.orientation;
  const KDL::Frame wanted(KDL::Rotation::Quaternion(o.x(), o.y(), o.z(), o.w()),
                          KDL::Vector(p.x(), p.y(), p.z()));
  const KDL::Twist error = KDL::diff(now, wanted);
  const Vector3 &v = reference.velocity, &w = reference.angular_velocity;
  const KDL::Twist twist(KDL::Vector(v.x(), v.y(), v.z()) + 20.0 * error.vel,
                         KDL::Vector(w.x(), w.y(), w.z()) + 20.0 * error.rot);
  solver.CartToJnt(joints, twist, velocity);
  JointVector result = velocity.data;
  const double ratio = (result.array().abs() / limit.array()).maxCoeff();
  return ratio > 1.0 ? JointVector(result / ratio) : result;
}

/// Where the candidates are asked: random postures, and for each a reference near by.
struct Inputs {
  std::vector<JointVector> postures;
  std::vector<CartesianReference> references;

  explicit Inputs(const Chain& chain) {
    std::mt19937 engine(7);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    const auto random = [&] { return Vector3(uniform(engine), uniform(engine), uniform(engine)); };
    for (int i = 0; i < kPostures; ++i) {
      JointVector q;
      for (int j = 0; j < kMaxJoints; ++j) q[j] = (j % 2 ? 1.8 : 2.6) * uniform(engine);
      postures.push_back(q);
    }
    for (const JointVector& q : postures) {
      CartesianReference reference;
      reference.pose = chain.evaluate(q).tool;
      reference.pose.position += 0.001 * random();
      reference.velocity = 0.3 * random();
      reference.angular_velocity = 0.3 * random();
      references.push_back(reference);
    }
  }
};

/// What is timed, ours and KDL's, on the same inputs.
class Calls {
 public:
  Calls(const Chain& chain, const CartesianMotionPlan& plan)
      : chain_(chain),
        plan_(plan),
        inputs_(chain),
        fk_(chain.kdl()),
        jacobian_solver_(chain.kdl()),
        pinv_(chain.kdl()),
        wdls_(chain.kdl()),
        guard_(GuardParameters{}, chain) {
    wdls_.setLambda(0.05);
    goal_.position = Vector3(0.6, 0.1, 0.4);
  }

  double dmpStep(int i) {
    if (i % 240 == 0)
      dmp_.start(plan_.system, Vector3::Zero(), Vector3::Zero(), goal_.position, 1.0);
    return dmp_.step(0.005, goal_.position).position.x();
  }
  double kinematics(int i) {
    chain_.evaluate(posture(i), state_);
    return state_.jacobian(0, 0);
  }
  double kinematicsOfKdl(int i) {
    joints_.data = posture(i);
    fk_.JntToCart(joints_, frame_);
    jacobian_solver_.JntToJac(joints_, jacobian_);
    return jacobian_(0, 0) + frame_.p.x();
  }
  double inverse(int i) {
    chain_.evaluate(posture(i), state_);
    ik_.solve(state_, posture(i), inputs_.references[i % kPostures], result_);
    return result_.velocity[0];
  }
  template <typename Solver>
  double inverseOfKdl(Solver Calls::*solver, int i) {
    return kdlCycle(fk_, this->*solver, posture(i), inputs_.references[i % kPostures], limit_)[0];
  }
  double cycle(int i) {
    chain_.evaluate(posture(i), state_);
    ik_.solve(state_, posture(i), reference(motion_, i), result_);
    guard_.limit(state_, posture(i), result_.velocity, limited_);
    return limited_.velocity[0];
  }
  template <typename Solver>
  double cycleOfKdl(Solver Calls::*solver, int i) {
    const JointVector velocity =
        kdlCycle(fk_, this->*solver, posture(i), reference(kdl_motion_, i), limit_);
    chain_.evaluate(posture(i), state_);
    guard_.limit(state_, posture(i), velocity, limited_);
    return limited_.velocity[0];
  }

  std::vector<Candidate> candidates() {
    return {
        {"dmp_step_20", [this](int i) { return dmpStep(i); }, {}},
        {"fk_jacobian", [this](int i) { return kinematics(i); }, {}},
        {"kdl_fk_jacobian", [this](int i) { return kinematicsOfKdl(i); }, {}},
        {"two_task_ik", [this](int i) { return inverse(i); }, {}},
        {"kdl_pinv", [this](int i) { return inverseOfKdl(&Calls::pinv_, i); }, {}},
        {"kdl_wdls", [this](int i) { return inverseOfKdl(&Calls::wdls_, i); }, {}},
        {"cycle", [this](int i) { return cycle(i); }, {}},
        {"cycle_kdl_wdls", [this](int i) { return cycleOfKdl(&Calls::wdls_, i); }, {}},
        {"cycle_kdl_pinv", [this](int i) { return cycleOfKdl(&Calls::pinv_, i); }, {}},
    };
  }

 private:
  const JointVector& posture(int i) const { return inputs_.postures[i % kPostures]; }
  const CartesianReference& reference(CartesianMotion& motion, int i) {
    if (i % 240 == 0) motion.start(plan_, Pose{}, Vector3::Zero(), Vector3::Zero(), goal_);
    return motion.step(0.005, goal_);
  }

  const Chain& chain_;
  const CartesianMotionPlan& plan_;
  const Inputs inputs_;
  KDL::ChainFkSolverPos_recursive fk_;
  KDL::ChainJntToJacSolver jacobian_solver_;
  KDL::ChainIkSolverVel_pinv pinv_;
  KDL::ChainIkSolverVel_wdls wdls_;
  const TwoTaskIk ik_;
  const JointVector limit_ = ik_.parameters().velocity_limit;
  Guard guard_;
  CartesianMotion motion_, kdl_motion_;
  Dmp dmp_;
  ChainState state_;
  IkResult result_;
  GuardResult limited_;
  KDL::JntArray joints_{kMaxJoints};
  KDL::Jacobian jacobian_{kMaxJoints};
  KDL::Frame frame_;
  Pose goal_;
};

/// Times all candidates in alternating blocks. The sum keeps the compiler from dropping calls.
double measure(std::vector<Candidate>& candidates) {
  double sink = 0.0;
  for (int block = 0; block < kBlocks; ++block) {
    for (Candidate& candidate : candidates) {
      const double begin = now();
      for (int i = 0; i < kCallsPerBlock; ++i) sink += candidate.call(i);
      candidate.times.push_back((now() - begin) / kCallsPerBlock);
    }
  }
  return sink;
}

void print(const std::vector<Candidate>& candidates, bool finite) {
  std::printf("{");
  for (const Candidate& candidate : candidates) {
    std::printf("\"%s\": %.4f, ", candidate.name.c_str(), median(candidate.times));
  }
  const auto times = [&](const std::string& name) -> const std::vector<double>& {
    return std::find_if(candidates.begin(), candidates.end(),
                        [&](const Candidate& c) { return c.name == name; })
        ->times;
  };
  for (const char* peer : {"wdls", "pinv"}) {
    std::vector<double> shares = times("cycle");
    for (int i = 0; i < kBlocks; ++i) shares[i] /= times(std::string("cycle_kdl_") + peer)[i];
    std::printf("\"share_of_kdl_%s\": %.4f, ", peer, median(shares));
  }
  std::printf("\"calls\": %d, \"finite\": %s}\n", kCallsPerBlock * kBlocks,
              finite ? "true" : "false");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: core_times URDF PRIMITIVES\n";
    return 2;
  }
  std::ifstream file(argv[1]);
  std::stringstream urdf;
  urdf << file.rdbuf();
  const Chain chain(urdf.str(), "lwr_base_link", "ih2_palm");
  Library library;
  library.load(argv[2]);
  const CartesianMotionPlan plan{TransformationSystem(library.at("reach_human")), 1.0, true};
  Calls calls(chain, plan);
  std::vector<Candidate> candidates = calls.candidates();
  const double sink = measure(candidates);
  print(candidates, std::isfinite(sink));
  return 0;
}
