// Motion controllers that misbehave on demand, one of them (CRASHING) as soon as it is made, as a
// shared object for the tests of the manager.
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <stdexcept>
#include <string>

#include "coglab_controllers/manager/parameters.hpp"
#include "coglab_controllers/manager/plugin_registry.hpp"

namespace {

using namespace coglab_controllers;

/// Moves slowly. After `after` cycles it makes the fault of its parameter `fault`: throw,
/// throw_int, nan, slow or stall. `slow` is quick again in every `rest_every`-th cycle, `rests`
/// times.
class Misbehaving : public MotionController {
 public:
#ifdef CRASHING
  Misbehaving() { std::raise(SIGSEGV); }
#endif
  void configure(const MotionSetup& setup) override {
    const Parameters parameters(setup.parameters, setup.id);
    fault_ = parameters.text("fault", "none");
    after_ = parameters.whole("after", 10, 0, 1000000);
    rest_every_ = parameters.whole("rest_every", 0, 0, 1000000);
    rests_ = parameters.whole("rests", 0, 0, 1000000);
    if (fault_ == "configure") throw std::runtime_error("configure was told to fail");
  }
  void adopt(const CycleInput&) override {}
  void start(const CycleInput&) override {
    cycles_ = 0;
    state_ = MotionState::Running;
  }
  void stop() override { state_ = MotionState::Idle; }
  void abort(const Reason& reason) override {
    state_ = MotionState::Aborted;
    reason_ = reason;
  }
  void computeReference(const CycleInput&, References&) override {
    if (++cycles_ <= after_) return;
    if (fault_ == "throw") throw std::runtime_error("told to throw");
    if (fault_ == "throw_int") throw 7;
    if (fault_ == "slow" && !resting()) wait(0.02);
    if (fault_ == "stall") wait(1.5);
  }
  void resolve(const CycleInput&, References& references) override {
    auto velocity = references.states.view<kMaxJoints>(references.joint_velocity);
    velocity.setConstant(0.01);
    if (fault_ == "nan" && cycles_ > after_) velocity[3] = std::nan("");
  }
  MotionState state() const override { return state_; }
  const Reason& reason() const override { return reason_; }

 private:
  bool resting() {
    if (rest_every_ == 0 || cycles_ % rest_every_ != 0 || rests_ == 0) return false;
    --rests_;
    return true;
  }

  static void wait(double seconds) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (std::chrono::steady_clock::now() < end) {
    }
  }

  std::string fault_;
  int after_ = 0, cycles_ = 0, rest_every_ = 0, rests_ = 0;
  MotionState state_ = MotionState::Idle;
  Reason reason_;
};

}  // namespace

COGLAB_REGISTER_MOTION_CONTROLLER(COGLAB_TEST_TYPE, Misbehaving)
