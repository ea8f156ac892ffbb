// Nothing that runs in the control cycle touches the heap.
#include <gtest/gtest.h>

#include <cstdlib>

#include "coglab_controllers/dmp/cartesian_motion.hpp"
#include "coglab_controllers/ik/two_task_ik.hpp"
#include "coglab_controllers/limits/guard.hpp"
#include "coglab_controllers/limits/phase_governor.hpp"
#include "coglab_controllers/ptp/ptp_trajectory.hpp"
#include "core_support.hpp"

extern "C" {
void* __libc_malloc(std::size_t size);
void __libc_free(void* block);
static long allocations = 0;
static bool counting = false;
void* malloc(std::size_t size) {
  if (counting) ++allocations;
  return __libc_malloc(size);
}
void free(void* block) {
  if (counting && block != nullptr) ++allocations;
  __libc_free(block);
}
}

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

// Counts while it lives.
struct Counted {
  Counted() {
    allocations = 0;
    counting = true;
  }
  ~Counted() { counting = false; }
};

}  // namespace

TEST(Allocation, TheCounterCounts) {
  long seen = 0;
  {
    Counted counted;
    std::free(std::malloc(100));
    seen = allocations;
  }
  EXPECT_GE(seen, 1);
}

TEST(Allocation, AWholeCycleTouchesNoHeap) {
  Random random(1);
  const Primitive one = randomPrimitive(random), two = randomPrimitive(random);
  const DmpPlan plan{Dmp(one), 1.0, true}, other{Dmp(two), 1.5, true};
  CartesianMotion motion;
  const TwoTaskIk ik;
  const PostureTask posture(JointVector::Zero(), 1.0);
  const AxisTask axis(Vector3::UnitX(), 1.0);
  Guard guard(GuardParameters{}, robot());
  PhaseGovernor governor;
  const JointVector home = random.posture(1.0);
  const PtpTrajectory trajectory(home, random.joints(0.5), JointVector::Zero(), JointVector::Ones(),
                                 JointVector::Ones());
  long seen = 0;
  {
    Counted counted;
    ChainState state;
    IkResult result;
    GuardResult limited;
    PtpPoint point;
    JointVector q = home;
    Pose goal;
    for (int i = 0; i < 100000; ++i) {
      robot().evaluate(q, state);
      if (i % 1000 == 0) {
        goal.position = Vector3(0.5, 0.1 * (i % 7), 0.4);
        motion.start(plan, state.tool, Vector3::Zero(), Vector3::Zero(), goal);
      }
      if (i % 1000 == 300) motion.switchTo(other, goal);
      const double rate = governor.update(0.005, 1.0, result.scale * limited.scale);
      const CartesianReference& reference = motion.step(0.005, goal, rate);
      if (i % 2) {
        ik.solve(state, q, reference, result);
      } else if (i % 4) {
        ik.solve(state, q, reference, axis, result);
      } else {
        ik.solve(state, q, reference, posture, result);
      }
      guard.limit(state, q, result.velocity, limited);
      trajectory.at(0.001 * (i % 5000), point);
      q += 0.005 * limited.velocity;
    }
    seen = allocations;
  }
  EXPECT_EQ(seen, 0);
}
