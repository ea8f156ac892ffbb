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

  std::mt19937 engine(7);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::vector<JointVector> postures;
  for (int i = 0; i < kPostures; ++i) {
    JointVector q;
    for (int j = 0; j < kMaxJoints; ++j) q[j] = (j % 2 ? 1.8 : 2.6) * uniform(engine);
    postures.push_back(q);
  }
  std::vector<CartesianReference> references;
  for (const JointVector& q : postures) {
    CartesianReference reference;
    reference.pose = chain.evaluate(q).tool;
    reference.pose.position += 0.001 * Vector3(uniform(engine), uniform(engine), uniform(engine));
    reference.velocity = 0.3 * Vector3(uniform(engine), uniform(engine), uniform(engine));
    reference.angular_velocity = 0.3 * Vector3(uniform(engine), uniform(engine), uniform(engine));
    references.push_back(reference);
  }

  KDL::ChainFkSolverPos_recursive fk(chain.kdl());
  KDL::ChainJntToJacSolver jacobian_solver(chain.kdl());
  KDL::ChainIkSolverVel_pinv pinv(chain.kdl());
  KDL::ChainIkSolverVel_wdls wdls(chain.kdl());
  wdls.setLambda(0.05);
  const TwoTaskIk ik;
  const JointVector limit = ik.parameters().velocity_limit;
  Guard guard(GuardParameters{}, chain);
  CartesianMotion motion, kdl_motion;
  Dmp dmp;
  ChainState state;
  IkResult result;
  GuardResult limited;
  KDL::JntArray joints(kMaxJoints);
  KDL::Jacobian jacobian(kMaxJoints);
  KDL::Frame frame;
  Pose goal;
  goal.position = Vector3(0.6, 0.1, 0.4);
  const auto restarted = [&](CartesianMotion& m, int i) -> const CartesianReference& {
    if (i % 240 == 0) m.start(plan, Pose{}, Vector3::Zero(), Vector3::Zero(), goal);
    return m.step(0.005, goal);
  };

  std::vector<Candidate> candidates = {
      {"dmp_step_20",
       [&](int i) {
         if (i % 240 == 0)
           dmp.start(plan.system, Vector3::Zero(), Vector3::Zero(), goal.position, 1.0);
         return dmp.step(0.005, goal.position).position.x();
       },
       {}},
      {"fk_jacobian",
       [&](int i) {
         chain.evaluate(postures[i % kPostures], state);
         return state.jacobian(0, 0);
       },
       {}},
      {"kdl_fk_jacobian",
       [&](int i) {
         joints.data = postures[i % kPostures];
         fk.JntToCart(joints, frame);
         jacobian_solver.JntToJac(joints, jacobian);
         return jacobian(0, 0) + frame.p.x();
       },
       {}},
      {"two_task_ik",
       [&](int i) {
         chain.evaluate(postures[i % kPostures], state);
         ik.solve(state, postures[i % kPostures], references[i % kPostures], result);
         return result.velocity[0];
       },
       {}},
      {"kdl_pinv",
       [&](int i) {
         return kdlCycle(fk, pinv, postures[i % kPostures], references[i % kPostures], limit)[0];
       },
       {}},
      {"kdl_wdls",
       [&](int i) {
         return kdlCycle(fk, wdls, postures[i % kPostures], references[i % kPostures], limit)[0];
       },
       {}},
      {"cycle",
       [&](int i) {
         const JointVector& q = postures[i % kPostures];
         chain.evaluate(q, state);
         ik.solve(state, q, restarted(motion, i), result);
         guard.limit(state, q, result.velocity, 0.005, limited);
         return limited.velocity[0];
       },
       {}},
      {"cycle_kdl_wdls",
       [&](int i) {
         const JointVector& q = postures[i % kPostures];
         const JointVector velocity = kdlCycle(fk, wdls, q, restarted(kdl_motion, i), limit);
         chain.evaluate(q, state);
         guard.limit(state, q, velocity, 0.005, limited);
         return limited.velocity[0];
       },
       {}},
      {"cycle_kdl_pinv",
       [&](int i) {
         const JointVector& q = postures[i % kPostures];
         const JointVector velocity = kdlCycle(fk, pinv, q, restarted(kdl_motion, i), limit);
         chain.evaluate(q, state);
         guard.limit(state, q, velocity, 0.005, limited);
         return limited.velocity[0];
       },
       {}},
  };
  double sink = 0.0;
  for (int block = 0; block < kBlocks; ++block) {
    for (Candidate& candidate : candidates) {
      const double begin = now();
      for (int i = 0; i < kCallsPerBlock; ++i) sink += candidate.call(i);
      candidate.times.push_back((now() - begin) / kCallsPerBlock);
    }
  }
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
  // The sum keeps the compiler from dropping calls.
  std::printf("\"calls\": %d, \"finite\": %s}\n", kCallsPerBlock * kBlocks,
              std::isfinite(sink) ? "true" : "false");
  return 0;
}
