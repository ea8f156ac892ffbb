// Goals on their whole way (tf listener, tf source, gate, estimator, DMP, inverse kinematics) in
// virtual time, with clocks that jitter and drift: outliers, silence, stamps from the future.
// Prints one JSON object.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <fstream>
#include <memory>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>

#include <ros/time.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include "coglab_controllers/manager/controller_manager.hpp"
#include "coglab_controllers/plugins/dmp_controller.hpp"
#include "coglab_controllers/ros/tf_goal_source.hpp"
#include "coglab_controllers/ros/tf_listener.hpp"
#include "coglab_rt/joint_limits_table.hpp"

namespace {

using namespace coglab_controllers;

constexpr std::int64_t kMillisecond = 1'000'000;
constexpr double kFollowed = 0.1;  // m from the last correct frame: the outlier is believed
constexpr double kDuration = 2.0;  // s watched after the start of a motion
const Vector3 kGoal(0.80, 0.0, 0.45);

std::string readText(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

void must(const Answer& answer) {
  if (!answer.success) throw std::runtime_error(answer.message);
}

/// The two clocks of this computer and the one of the tracker's, read one after another: each
/// reading takes a moment, now and then a long one, and each clock drifts.
class Clocks {
 public:
  explicit Clocks(std::mt19937& random) : random_(random) {
    std::uniform_real_distribution<double> ppm(-50.0, 50.0), ms(-10.0, 10.0);
    drift_ = 1e-6 * ppm(random_);
    tracker_drift_ = 1e-6 * ppm(random_);
    tracker_offset_ns_ = static_cast<std::int64_t>(1e6 * ms(random_));
  }
  void advance(std::int64_t ns) {
    true_ns_ += ns;
    ros::Time now;
    now.fromNSec(static_cast<std::uint64_t>(ros() + reading()));
    ros::Time::setNow(now);
  }
  std::int64_t trueNs() const { return true_ns_; }
  std::int64_t steady() { return true_ns_ + reading(); }
  std::int64_t ros() const { return kEpoch + drifted(drift_); }
  /// What the tracker stamps now: its computer is synchronised to some milliseconds.
  std::int64_t tracker() const { return kEpoch + drifted(tracker_drift_) + tracker_offset_ns_; }

 private:
  static constexpr std::int64_t kEpoch = 1'790'000'000'000'000'000;
  std::int64_t drifted(double drift) const {
    return true_ns_ + std::llround(drift * static_cast<double>(true_ns_));
  }
  std::int64_t reading() {
    std::exponential_distribution<double> quick(1.0 / 800.0), preempted(1.0 / 300e3);
    const bool slow = std::uniform_int_distribution<int>(0, 99)(random_) == 0;
    return std::llround(slow ? preempted(random_) : quick(random_));
  }
  std::mt19937& random_;
  std::int64_t true_ns_ = 1'000'000'000;
  double drift_ = 0.0, tracker_drift_ = 0.0;
  std::int64_t tracker_offset_ns_ = 0;
};

/// Counts what the source gives. With `mapped`, frames are told apart by the time they map to, as
/// is tempting: what that costs is the figure beside ours.
class Watched : public GoalSource {
 public:
  Watched(GoalSource& source, bool mapped) : source_(source), mapped_(mapped) {}
  bool lookup(const std::string& reference, const std::string& frame, GoalObservation& observation,
              std::string& why) override {
    if (!source_.lookup(reference, frame, observation, why)) return false;
    given_ns = observation.frame_ns;
    if (mapped_) observation.frame_ns = observation.stamp_ns;
    return true;
  }
  double ahead(const std::string& frame) override { return source_.ahead(frame); }
  std::int64_t given_ns = 0;

 private:
  GoalSource& source_;
  bool mapped_;
};

/// What one run does to the goal.
struct Disturbance {
  double rate = 30.0;    ///< frames per second
  bool outlier = false;  ///< one frame 0.5 m off
  bool silence = false;  ///< and none after it
  double ahead = 0.0;    ///< s: frames 0.5 m off, stamped so far from now; 0: none
  bool mapped = false;
};

struct Outcome {
  bool followed = false;
  int correct = 0;  ///< correct frames after the first one from the future
  int ignored = 0;  ///< of these: not the goal although they were the newest, or the motion held
};

class Run {
 public:
  Run(const std::string& package, const std::string& description, unsigned seed,
      const Disturbance& what)
      : random_(seed), clocks_(random_), what_(what) {
    YAML::Node node;
    node["dmp"]["dmp_file"] = package + "/config/primitives.xml";
    ManagerSettings settings = readManagerSettings(
        node, readText(description + "/urdf/lwr_ih2.urdf"),
        coglab_rt::loadJointLimits(description + "/config/joint_limits.yaml"), true);
    settings.clock = [this] { return clocks_.steady(); };
    settings.logger = &logger_;
    manager_ = std::make_unique<ControllerManager>(std::move(settings));
    must(manager_->load("dmp", "coglab/DmpController"));
    dmp().setGoalSource(&watched_);
    sample_.position << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782;
    sample_.commanded_position = sample_.position;
    sample_.block = coglab_rt::MotionBlock::None;
    sample_.cycle_time = 0.005;
    std::string type;
    must(manager_->switchTo("dmp", type));
    const double when = std::uniform_real_distribution<double>(0.2, 0.7)(random_);
    disturb_ns_ = static_cast<std::int64_t>(1e9 * when);
    const double angle = std::uniform_real_distribution<double>(0.0, 2.0 * M_PI)(random_);
    aside_ = 0.5 * Vector3(0.0, std::cos(angle), std::sin(angle));
  }
  ~Run() { dmp().setGoalSource(nullptr); }

  Outcome run() {
    for (int ms = 0; ms < 300; ++ms) step();
    DmpRequest request;
    request.primitive_id = "reach_human";
    request.goal_frame = "human_hand";
    must(dmp().execute(request));
    begin_ns_ = clocks_.trueNs();
    for (int ms = 0; ms < static_cast<int>(1000.0 * kDuration); ++ms) step();
    return outcome_;
  }

 private:
  struct Frame {
    tf2_msgs::TFMessage message;
    std::int64_t arrives_ns = 0;
    bool correct = true;
  };

  DmpController& dmp() { return dynamic_cast<DmpController&>(*manager_->motion("dmp")); }

  /// 1 ms: what is due of tracker, network, poll and cycle.
  void step() {
    clocks_.advance(kMillisecond);
    const std::int64_t now = clocks_.trueNs();
    if (now >= next_frame_ns_) capture(now);
    while (!under_way_.empty() && under_way_.front().arrives_ns <= now) deliver();
    if (now >= next_poll_ns_) {
      dmp().pollGoal();
      polled_ = true;
      const int late = std::uniform_int_distribution<int>(0, 9)(random_) == 0 ? 3 : 0;
      next_poll_ns_ += (5 + late) * kMillisecond;
    }
    if (now >= next_cycle_ns_) {
      cycle();
      next_cycle_ns_ += 5 * kMillisecond;
    }
  }

  Vector3 hand(std::int64_t now) const {
    const double t = 1e-9 * static_cast<double>(now);
    return kGoal + Vector3(0.02 * std::sin(1.3 * t), 0.03 * std::sin(2.1 * t), 0.02 * std::cos(t));
  }

  void capture(std::int64_t now) {
    const std::int64_t period = static_cast<std::int64_t>(1e9 / what_.rate);
    next_frame_ns_ = now + period + noise(0.05 * static_cast<double>(period));
    const bool due = begin_ns_ != 0 && now >= begin_ns_ + disturb_ns_;
    const bool once = due && what_.outlier && !disturbed_;
    if (due && what_.outlier && what_.silence && disturbed_) return;
    if (due && what_.ahead != 0.0 && sent_ahead_ < 5) {
      send(now, hand(now) + aside_, what_.ahead, false);
      ++sent_ahead_;
    }
    send(now, once ? Vector3(hand(now) + aside_) : hand(now), 0.0, !once);
    disturbed_ = disturbed_ || due;
  }

  void send(std::int64_t now, const Vector3& position, double ahead, bool correct) {
    Frame frame;
    frame.correct = correct;
    geometry_msgs::TransformStamped seen;
    const double stamp = 1e-9 * static_cast<double>(clocks_.tracker()) + ahead;
    if (stamp >= 4294967295.0) {
      seen.header.stamp = ros::Time(4294967295u, 999'999'999u);
    } else {
      seen.header.stamp.fromNSec(static_cast<std::uint64_t>(
          (ahead != 0.0 ? clocks_.ros() : clocks_.tracker()) + std::llround(1e9 * ahead)));
    }
    seen.header.frame_id = "lwr_base_link";
    seen.child_frame_id = "human_hand";
    seen.transform.translation.x = position.x() + 0.002 * normal();
    seen.transform.translation.y = position.y() + 0.002 * normal();
    seen.transform.translation.z = position.z() + 0.002 * normal();
    seen.transform.rotation.w = 1.0;
    frame.message.transforms.push_back(seen);
    // In order, as over one connection; what is to come from the future must not wait for it.
    const std::int64_t delay = ahead != 0.0 ? 0 : 15 * kMillisecond + std::abs(noise(5e6));
    frame.arrives_ns = now + delay;
    if (ahead != 0.0) {
      under_way_.push_front(frame);
      return;
    }
    if (!under_way_.empty()) {
      frame.arrives_ns = std::max(frame.arrives_ns, under_way_.back().arrives_ns);
    }
    under_way_.push_back(frame);
  }

  void deliver() {
    const Frame frame = under_way_.front();
    under_way_.pop_front();
    listener_.receive(frame.message, "/tracker", false);
    if (!frame.correct) return;
    if (sent_ahead_ > 0) judge();
    const geometry_msgs::TransformStamped& seen = frame.message.transforms[0];
    const auto& t = seen.transform.translation;
    correct_ = Vector3(t.x, t.y, t.z);
    correct_ns_ = static_cast<std::int64_t>(seen.header.stamp.toNSec());
    polled_ = held_ = false;
  }

  /// Of the correct frame that is replaced now: was it the goal while it was the newest?
  void judge() {
    if (correct_ns_ == 0 || !polled_) return;
    ++outcome_.correct;
    if (watched_.given_ns != correct_ns_ || held_) ++outcome_.ignored;
  }

  void cycle() {
    ++sample_.sequence;
    sample_.stamp_ns = clocks_.trueNs();
    manager_->cycle().run(sample_, 0.005, command_);
    sample_.commanded_acceleration = (command_.velocity - sample_.commanded_velocity) / 0.005;
    sample_.position += 0.005 * command_.velocity;
    sample_.velocity = sample_.commanded_velocity = command_.velocity;
    sample_.commanded_position = sample_.position;
    if (begin_ns_ == 0) return;
    if (manager_->report().motion == MotionState::Holding) held_ = true;
    if (!disturbed_ || manager_->report().motion == MotionState::Aborted) return;
    if ((dmp().motion().goal() - correct_).norm() > kFollowed) outcome_.followed = true;
  }

  std::int64_t noise(double scale) { return std::llround(scale * normal()); }
  double normal() { return std::normal_distribution<double>()(random_); }

  std::mt19937 random_;
  Clocks clocks_;
  Disturbance what_;
  ctrl_more::Logger logger_;
  tf2::BufferCore buffer_{ros::Duration(10.0)};
  TfListener listener_{buffer_};
  TfGoalSource source_{buffer_, listener_, [this] { return clocks_.steady(); }};
  Watched watched_{source_, what_.mapped};
  std::unique_ptr<ControllerManager> manager_;
  RobotSample sample_;
  VelocityCommand command_;
  std::deque<Frame> under_way_;
  std::int64_t next_frame_ns_ = 0, next_poll_ns_ = 0, next_cycle_ns_ = 0;
  std::int64_t begin_ns_ = 0, disturb_ns_ = 0, correct_ns_ = 0;
  Vector3 aside_, correct_ = kGoal;
  bool disturbed_ = false, polled_ = false, held_ = false;
  int sent_ahead_ = 0;
  Outcome outcome_;
};

Outcome campaign(const std::string& package, const std::string& description, int runs,
                 Disturbance what, const std::vector<double>& ahead, int& followed) {
  Outcome all;
  followed = 0;
  for (int i = 0; i < runs; ++i) {
    if (!ahead.empty()) what.ahead = ahead[static_cast<std::size_t>(i) % ahead.size()];
    const Outcome one = Run(package, description, static_cast<unsigned>(1000 + i), what).run();
    followed += one.followed ? 1 : 0;
    all.correct += one.correct;
    all.ignored += one.ignored;
  }
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: goal_gate_bench PACKAGE_DIR DESCRIPTION_DIR RUNS\n");
    return 2;
  }
  ros::Time::init();
  const std::string package = argv[1], description = argv[2];
  const int runs = std::stoi(argv[3]);
  std::printf("{\"runs\": %d, \"outlier\": [", runs);
  const char* comma = "";
  for (const double rate : {10.0, 30.0, 100.0}) {
    for (const bool silence : {false, true}) {
      int ours = 0, mapped = 0;
      Disturbance what;
      what.rate = rate;
      what.outlier = true;
      what.silence = silence;
      campaign(package, description, runs, what, {}, ours);
      what.mapped = true;
      campaign(package, description, runs, what, {}, mapped);
      std::printf("%s{\"rate\": %g, \"silence\": %s, \"followed\": %d, \"mapped\": %d}", comma,
                  rate, silence ? "true" : "false", ours, mapped);
      comma = ", ";
    }
  }
  int followed = 0;
  const Outcome future = campaign(package, description, runs, Disturbance(),
                                  {0.06, 0.2, 1.0, 10.0, 60.0, 1e6, 1e9, 4e9}, followed);
  std::printf("], \"future\": {\"followed\": %d, \"correct\": %d, \"ignored\": %d}}\n", followed,
              future.correct, future.ignored);
  return 0;
}
