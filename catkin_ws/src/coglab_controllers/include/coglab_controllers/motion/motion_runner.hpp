/// @file
/// The motion controller around a motion: requests, queue, start, end, abort and stand-still, once
/// for all. Where it stands in the control cycle: docs/architecture.md.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "coglab_controllers/manager/motion_controller.hpp"
#include "coglab_controllers/motion/motion.hpp"
#include "coglab_controllers/motion/reference_loop.hpp"

namespace coglab_controllers {

/// Answer to a request for a motion.
struct MotionAnswer : Answer {
  static constexpr int kStarted = 0, kQueued = 1, kRejected = 2;  ///< status

  int status = kRejected;
  int id = -1;  ///< of the motion; -1 if rejected

  static MotionAnswer rejected(const Answer& why) {
    MotionAnswer answer;
    static_cast<Answer&>(answer) = why;
    return answer;
  }
};

/// A motion that ended.
struct EndedMotion {
  int id = -1;
  bool executed = false;  ///< false: given up before its end
  Reason reason;          ///< why it was given up
};

/// How a runner runs its motions.
struct RunnerPolicy {
  /// The motion goes on after it was reached (a goal may leave again) until something ends it.
  bool open_end = false;
  const char* id_name = "motion_id";  ///< of motions in reasons; null: they are not named
  int longest_queue = 64;             ///< largest max_queue; 0: no queue
};

/// What a runner does at the moment.
enum class RunnerStage : std::uint8_t {
  Rest,      ///< no motion; the arm brakes to, or is at, stand-still
  Starting,  ///< one was adopted and begins with the next joint state that allows it
  Moving,    ///< one is under way
  Replacing  ///< one is under way until the next one begins
};

/// Runs motions of one kind, one after another. A motion that begins while the arm moves goes on
/// from its set-point; one that ends leaves the arm standing. The real-time side is the interface
/// of MotionController; offer() is for requests.
///
/// Parameters: those of ReferenceLoop, `settle_time` (s) and, with a queue, `max_queue`.
template <typename Request>
class MotionRunner : public MotionController {
 public:
  MotionRunner(std::unique_ptr<Motion<Request>> motion, const RunnerPolicy& policy)
      : policy_(policy), motion_(std::move(motion)) {}

  /// Motions that ended since the last call; one reader thread.
  bool readEnd(EndedMotion& end) { return ends_.pop(end); }
  const std::string& id() const { return setup_.id; }

  // MotionController
  void configure(const MotionSetup& setup) override;
  void adopt(const CycleInput& input) override;
  void start(const CycleInput& input) override;
  void stop() override;
  void abort(const Reason& reason) override;
  void computeReference(const CycleInput& input, References& references) override;
  void resolve(const CycleInput& input, References& references) override {
    loop_.resolve(input, references);
    report(input.robot.stamp_ns);
  }
  double limitScale() const override { return loop_.ik().scale; }
  int motionId() const override { return current_.id; }
  bool endIfThere(const CycleInput& input) override;
  MotionState state() const override { return state_; }
  const Reason& reason() const override { return reason_; }

 protected:
  /// Hands a checked request to the cycle and waits until it is adopted.
  /// @param begun from MotionHost::beginRequest(), welcome
  /// @param queue wait for the end of the motion under way; false: replace it, and what waits
  MotionAnswer offer(const MotionRequest& begun, const Request& request, bool queue);

  /// Why this request cannot be adopted now; empty: it can. Control thread.
  virtual Reason unwelcome(const Request& /*request*/) const { return {}; }
  /// Tells what the cycle did, at its end and when the controller starts and stops. Control thread.
  virtual void report(std::int64_t stamp_ns) = 0;

  Motion<Request>& inner() { return *motion_; }
  RunnerStage stage() const { return stage_; }         ///< control thread
  const ReferenceLoop& loop() const { return loop_; }  ///< control thread
  const MotionSetup& setup() const { return setup_; }
  const std::vector<MotionArgument>& arguments() const { return arguments_; }
  int runningId() const { return current_.id; }  ///< control thread; of the last motion
  int queued() const { return queued_; }         ///< control thread
  double time() const { return time_; }          ///< control thread; s, of the motion's own

 private:
  struct Entry {
    int id = -1;
    Request request;
  };
  struct Plan {
    RequestStamp stamp;
    bool queue = false;
    Entry entry;
    int status = MotionAnswer::kRejected;  ///< written by the cycle
    Reason refusal;                        ///< written by the cycle
  };

  void place(Plan& plan);
  void begin(const CycleInput& input, bool at_rest);
  void arrive(const CycleInput& input);
  void reach(const CycleInput& input);
  void follow();
  void endQueued(const Reason& why, Reason& told);
  void tell(int id, const Reason& why, Reason& told);
  void giveUp(const Reason& why);

  const RunnerPolicy policy_;
  MotionSetup setup_;
  std::vector<MotionArgument> arguments_;
  PlanExchange<Plan> plans_;
  int next_id_ = 0;  // under the host's request lock

  // control thread
  std::unique_ptr<Motion<Request>> motion_;
  RunnerStage stage_ = RunnerStage::Rest;
  MotionState state_ = MotionState::Idle;
  Reason reason_;
  Entry current_, next_;      // the motion under way, and the one that begins
  std::vector<Entry> queue_;  // a ring; its size is fixed by configure()
  std::size_t first_ = 0;
  int queued_ = 0, unfinished_ = 0;
  double time_ = 0.0;
  std::int64_t stamp_ns_ = 0;
  ReferenceLoop loop_;
  Arrival arrival_;
  EventRing<EndedMotion, 256> ends_;
};

}  // namespace coglab_controllers

#include "coglab_controllers/motion/motion_runner_impl.hpp"
