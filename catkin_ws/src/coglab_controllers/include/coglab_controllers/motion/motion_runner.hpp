/// @file
/// Base class of motion controllers that run a Motion<>. It handles requests, queue, start, end,
/// abort and standstill. Its place in the control cycle: docs/architecture.md.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
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
  bool executed = false;  ///< false: aborted before its end
  Reason reason;          ///< reason of the abort; else empty
};

/// Progress of the current motion, for motion_feedback.
struct MotionProgress {
  std::int64_t stamp_ns = 0;
  int id = -1;  ///< of the current or last motion; -1: none yet
  MotionState state = MotionState::Idle;
  Reason reason;
  double time = 0.0;  ///< s since the start, in motion time
  int queued = 0;
};

/// Settings of a runner.
struct RunnerPolicy {
  /// true: the motion continues after it has reached its goal, because the goal may move again.
  bool open_end = false;
  const char* id_name = "motion_id";  ///< name of the motion ids in reasons; null: no ids there
  int longest_queue = 64;             ///< largest max_queue; 0: no queue
  ReferenceLoop::Spaces spaces = ReferenceLoop::Spaces::Both;  ///< of its references
};

/// Stage of a runner.
enum class RunnerStage : std::uint8_t {
  Rest,      ///< no motion; the arm brakes or stands
  Starting,  ///< a motion was adopted; it begins with the next joint state that allows motion
  Moving,    ///< a motion runs
  Replacing  ///< a motion runs until the adopted one begins
};

/// Runs motions of one kind, one after another. A motion that begins while the arm moves continues
/// from the current set-point. After the last motion the arm stands. The control cycle calls the
/// interface of MotionController; requests call offer().
///
/// Parameters: those of ReferenceLoop, `settle_time` (s) and, with a queue, `max_queue`.
template <typename Request>
class MotionRunner : public MotionController {
 public:
  MotionRunner(std::unique_ptr<Motion<Request>> motion, const RunnerPolicy& policy)
      : policy_(policy), motion_(std::move(motion)) {}

  /// Reads the next motion that ended; false if there is none. One reader thread.
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
  Tunables* tunables() override { return &tunables_; }
  MotionState state() const override { return state_; }
  const Reason& reason() const override { return reason_; }

 protected:
  /// Passes a checked request to the cycle and waits until the cycle adopts it.
  /// @param begun an accepted result of MotionHost::beginRequest()
  /// @param queue true: start after the current motion; false: replace it and the queue
  MotionAnswer offer(const MotionRequest& begun, const Request& request, bool queue);

  /// Returns why this request cannot be adopted now; empty: it can. Control thread.
  virtual Reason unwelcome(const Request& /*request*/) const { return {}; }
  /// Reports the result of a cycle. Called at the end of each cycle and when the controller
  /// starts and stops. Control thread.
  virtual void report(std::int64_t stamp_ns) = 0;

  Motion<Request>& inner() { return *motion_; }
  RunnerStage stage() const { return stage_; }         ///< control thread
  const ReferenceLoop& loop() const { return loop_; }  ///< control thread
  const MotionSetup& setup() const { return setup_; }
  const std::vector<MotionArgument>& arguments() const { return arguments_; }
  int runningId() const { return current_.id; }  ///< control thread; of the current or last motion
  int queued() const { return queued_; }         ///< control thread
  double time() const { return time_; }          ///< control thread; s, motion time
  /// Control thread.
  MotionProgress progress(std::int64_t stamp_ns) const {
    return {stamp_ns, current_.id, state_, reason_, time_, queued_};
  }

 private:
  /// One request, passed to the cycle and kept there.
  struct Plan {
    int id = -1;
    Request request;
    RequestStamp stamp;
    bool queue = false;
    int status = MotionAnswer::kRejected;  ///< written by the cycle
    Reason refusal;                        ///< written by the cycle
  };

  void place(Plan& plan);
  void begin(const CycleInput& input, bool at_rest);
  void arrive(const CycleInput& input);
  void reach(const CycleInput& input);
  void follow();
  void endQueued(const Reason& why, Reason& summary);
  void reportEnd(int id, const Reason& why, Reason& summary);
  void giveUp(const Reason& why);

  const RunnerPolicy policy_;
  MotionSetup setup_;
  Tunables tunables_;
  std::vector<MotionArgument> arguments_;
  PlanExchange<Plan> plans_;
  int next_id_ = 0;  // under the host's request lock

  // control thread
  std::unique_ptr<Motion<Request>> motion_;
  RunnerStage stage_ = RunnerStage::Rest;
  MotionState state_ = MotionState::Idle;
  Reason reason_;
  Plan current_, next_;      // the running motion, and the one that begins next
  std::vector<Plan> queue_;  // ring buffer; configure() fixes its size
  std::size_t first_ = 0;
  int queued_ = 0, unfinished_ = 0;
  double time_ = 0.0;
  std::int64_t stamp_ns_ = 0;
  ReferenceLoop loop_;
  Arrival arrival_;
  EventRing<EndedMotion, 256> ends_;
};

template <typename Request>
void MotionRunner<Request>::configure(const MotionSetup& setup) {
  setup_ = setup;
  const Parameters parameters(setup.parameters, setup.id);
  loop_.configure(setup, policy_.spaces, tunables_);
  arrival_.configure(parameters);
  if (policy_.longest_queue > 0) {
    const int most = policy_.longest_queue;
    const int length = parameters.whole("max_queue", std::min(16, most), 0, most);
    queue_.resize(static_cast<std::size_t>(length));
  }
  MotionConfiguration configuration(setup_, tunables_);
  motion_->configure(configuration);
  arguments_ = configuration.arguments();
  if (std::function<void()> wait = setup.host->cycleWait()) plans_.setWait(wait);
}

template <typename Request>
MotionAnswer MotionRunner<Request>::offer(const MotionRequest& begun, const Request& request,
                                          bool queue) {
  auto plan = std::make_unique<Plan>();
  plan->stamp = begun.stamp;
  plan->queue = queue;
  plan->id = next_id_;
  plan->request = request;
  MotionAnswer answer;
  const PlanOutcome outcome =
      plans_.offer(std::move(plan), setup_.host->planTimeout(), [&answer](const Plan& adopted) {
        if (!adopted.refusal.empty())
          answer = MotionAnswer::rejected(Answer::refusal(adopted.refusal));
        answer.status = adopted.status;
      });
  if (outcome == PlanOutcome::Withdrawn) {
    return MotionAnswer::rejected(
        Answer::refusal(ReasonCode::NotAdopted, setup_.host->notAdopted(outcome)));
  }
  if (outcome == PlanOutcome::Taken) {
    answer.status = MotionAnswer::kQueued;
    answer.message = setup_.host->notAdopted(outcome);
  }
  if (answer.status != MotionAnswer::kRejected) answer.id = next_id_++;
  return answer;
}

// ---- the control thread
// --------------------------------------------------------------------------

template <typename Request>
void MotionRunner<Request>::start(const CycleInput& input) {
  stage_ = RunnerStage::Rest;
  state_ = MotionState::Idle;
  reason_.clear();
  queued_ = 0;
  motion_->stop();
  loop_.begin();
  stamp_ns_ = input.robot.stamp_ns;
  report(stamp_ns_);
}

template <typename Request>
void MotionRunner<Request>::stop() {
  if (stage_ != RunnerStage::Rest && state_ != MotionState::Reached) {
    giveUp(Reason(ReasonCode::Switched, "ended by a switch to another controller"));
  } else {
    stage_ = RunnerStage::Rest;
    motion_->stop();
  }
  if (state_ == MotionState::Reached) state_ = MotionState::Idle;
  report(stamp_ns_);
}

template <typename Request>
void MotionRunner<Request>::abort(const Reason& reason) {
  giveUp(reason);
}

template <typename Request>
void MotionRunner<Request>::adopt(const CycleInput& input) {
  Plan* const plan = plans_.take();
  if (plan == nullptr) return;
  plan->refusal = voidReason(plan->stamp, input);
  if (plan->refusal.empty()) plan->refusal = unwelcome(plan->request);
  if (plan->refusal.empty()) place(*plan);
  plans_.acknowledge();
}

template <typename Request>
void MotionRunner<Request>::place(Plan& plan) {
  if (plan.queue && stage_ != RunnerStage::Rest) {
    if (static_cast<std::size_t>(queued_) == queue_.size()) {
      plan.refusal = Reason(ReasonCode::QueueFull, "the queue is full: ")
                     << static_cast<std::uint64_t>(queued_) << " motions wait (max_queue "
                     << static_cast<std::uint64_t>(queue_.size()) << "); wait for the end of one";
      return;
    }
    queue_[(first_ + static_cast<std::size_t>(queued_++)) % queue_.size()] = plan;
    plan.status = MotionAnswer::kQueued;
    return;
  }
  if (stage_ != RunnerStage::Rest) {
    const Reason why(ReasonCode::Superseded, "a newer motion took its place");
    Reason summary;
    reportEnd(stage_ == RunnerStage::Moving ? current_.id : next_.id, why, summary);
    endQueued(why, summary);
  }
  // The motion begins with the next joint state. Without a new one, the commanded state is old.
  next_ = plan;
  stage_ = stage_ == RunnerStage::Rest || stage_ == RunnerStage::Starting ? RunnerStage::Starting
                                                                          : RunnerStage::Replacing;
  state_ = MotionState::Running;
  reason_.clear();
  plan.status = MotionAnswer::kStarted;
}

template <typename Request>
void MotionRunner<Request>::begin(const CycleInput& input, bool at_rest) {
  current_ = next_;
  stage_ = RunnerStage::Moving;
  state_ = MotionState::Running;
  reason_.clear();
  time_ = 0.0;
  arrival_.begin();
  const SetPoint from = loop_.setPoint(input, at_rest);
  motion_->start({current_.request, from, input});
}

/// The reference has ended. The motion ends when the measured arm arrives too.
template <typename Request>
void MotionRunner<Request>::arrive(const CycleInput& input) {
  switch (arrival_.update(input.dt, loop_.error(input), loop_.allowedError())) {
    case Arrival::State::Waiting:
      return;
    case Arrival::State::Stuck:
      giveUp(loop_.stuck(input));
      return;
    case Arrival::State::There:
      reach(input);
      return;
  }
}

template <typename Request>
void MotionRunner<Request>::reach(const CycleInput& input) {
  ends_.push({current_.id, true, {}});
  if (queued_ > 0) {
    next_ = queue_[first_];
    first_ = (first_ + 1) % queue_.size();
    --queued_;
    begin(input, true);
    return;
  }
  stage_ = RunnerStage::Rest;
  state_ = MotionState::Reached;
}

template <typename Request>
bool MotionRunner<Request>::endIfThere(const CycleInput& input) {
  if (stage_ != RunnerStage::Moving || !motion_->endIfThere(input)) return false;
  if (policy_.open_end) {
    follow();
  } else {
    reach(input);
  }
  return true;
}

template <typename Request>
void MotionRunner<Request>::computeReference(const CycleInput& input, References& references) {
  stamp_ns_ = input.robot.stamp_ns;
  const bool waits = stage_ == RunnerStage::Starting || stage_ == RunnerStage::Replacing;
  if (waits && input.motion_allowed) begin(input, false);
  if (stage_ == RunnerStage::Moving && !policy_.open_end &&
      motion_->state() == MotionState::Reached) {
    arrive(input);
  }
  MotionReference reference(input.dt);
  if (stage_ == RunnerStage::Moving) {
    const double next = time_ + input.dt * input.time_scale;
    motion_->computeReference({time_, next, input, loop_.ik()}, reference);
    time_ = next;
    follow();
    if (stage_ != RunnerStage::Moving) reference.rest();
  }
  loop_.write(input, reference, references);
}

/// Takes over the motion's state and reason.
template <typename Request>
void MotionRunner<Request>::follow() {
  const MotionState state = motion_->state();
  if (state == MotionState::Aborted) {
    giveUp(motion_->reason());
    return;
  }
  const bool ends_here = state == MotionState::Reached && !policy_.open_end;
  state_ = ends_here ? MotionState::Running : state;
  const Reason& reason = motion_->reason();
  if (!reason.empty() || !reason_.empty()) reason_ = reason;
}

template <typename Request>
void MotionRunner<Request>::reportEnd(int id, const Reason& why, Reason& summary) {
  ends_.push({id, false, why});
  if (policy_.id_name == nullptr) return;
  if (unfinished_++ == 0) {
    summary << "; not executed: " << policy_.id_name << " ";
  } else {
    summary << ", ";
  }
  summary << static_cast<std::uint64_t>(id);
}

template <typename Request>
void MotionRunner<Request>::endQueued(const Reason& why, Reason& summary) {
  for (; queued_ > 0; --queued_) {
    reportEnd(queue_[first_].id, why, summary);
    first_ = (first_ + 1) % queue_.size();
  }
}

template <typename Request>
void MotionRunner<Request>::giveUp(const Reason& why) {
  if (stage_ == RunnerStage::Rest) return;
  Reason summary = why;
  unfinished_ = 0;
  reportEnd(stage_ == RunnerStage::Moving ? current_.id : next_.id, why, summary);
  endQueued(why, summary);
  motion_->stop();
  loop_.open();
  stage_ = RunnerStage::Rest;
  state_ = MotionState::Aborted;
  reason_ = summary;
}

}  // namespace coglab_controllers
