// The control cycle runs freely while services are called. It makes no allocation, lock or system
// call.
#include <dlfcn.h>
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <shared_mutex>
#include <thread>

#include "coglab_rt/joint_limits_table.hpp"
#include "motion_types.hpp"
#include "remote_client.hpp"
#include "system_calls.hpp"
#include "virtual_robot.hpp"

namespace {
thread_local bool counting = false;
std::atomic<std::uint64_t> allocations{0}, locks{0};
}  // namespace

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);

// All allocations of the process use these functions.
void* malloc(std::size_t size) {
  if (counting) ++allocations;
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  if (counting) ++allocations;
  return __libc_calloc(count, size);
}
void* realloc(void* pointer, std::size_t size) {
  if (counting) ++allocations;
  return __libc_realloc(pointer, size);
}
void free(void* pointer) {
  if (counting && pointer != nullptr) ++allocations;
  __libc_free(pointer);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  if (counting) ++allocations;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** pointer, std::size_t alignment, std::size_t size) {
  if (counting) ++allocations;
  *pointer = __libc_memalign(alignment, size);
  return *pointer != nullptr ? 0 : ENOMEM;
}

#define COGLAB_COUNTED_LOCK(name, type)                                                     \
  int name(type* lock) {                                                                    \
    static const auto original = reinterpret_cast<int (*)(type*)>(dlsym(RTLD_NEXT, #name)); \
    if (counting) ++locks;                                                                  \
    return original(lock);                                                                  \
  }
COGLAB_COUNTED_LOCK(pthread_mutex_lock, pthread_mutex_t)
COGLAB_COUNTED_LOCK(pthread_mutex_trylock, pthread_mutex_t)
COGLAB_COUNTED_LOCK(pthread_rwlock_rdlock, pthread_rwlock_t)
COGLAB_COUNTED_LOCK(pthread_rwlock_wrlock, pthread_rwlock_t)
#undef COGLAB_COUNTED_LOCK
}

namespace coglab_controllers {
namespace {

TEST(Cycle, TheCounterCounts) {
  counting = true;
  void* volatile pointer = std::malloc(16);
  void* volatile aligned = std::aligned_alloc(64, 64);
  counting = false;
  std::free(pointer);
  std::free(aligned);
  EXPECT_EQ(allocations.exchange(0), 2u);
}

TEST(Cycle, TheLocksAreCounted) {
  std::mutex mutex;
  std::shared_mutex shared;
  counting = true;
  mutex.lock();
  mutex.unlock();
  if (mutex.try_lock()) mutex.unlock();
  shared.lock();
  shared.unlock();
  shared.lock_shared();
  shared.unlock_shared();
  counting = false;
  EXPECT_EQ(locks.exchange(0), 4u);
}

TEST(Cycle, TheCounterOfSystemCallsCounts) {
  bool enabled = false;
  std::uint64_t in_clock = 0, in_call = 0;
  std::thread thread([&] {
    enabled = SystemCalls::enable();
    if (!enabled) return;
    const std::uint64_t before = SystemCalls::count();
    SystemCalls::start();
    static_cast<void>(std::chrono::steady_clock::now());
    SystemCalls::stop();
    in_clock = SystemCalls::count() - before;
    SystemCalls::start();
    static_cast<void>(::getppid());
    SystemCalls::stop();
    in_call = SystemCalls::count() - before - in_clock;
  });
  thread.join();
  if (!enabled) GTEST_SKIP() << "this kernel has no syscall user dispatch (x86-64, Linux 5.11)";
  if (in_clock != 0) GTEST_SKIP() << "on this machine reading the clock is a system call";
  EXPECT_EQ(in_call, 1u);
  EXPECT_EQ(SystemCalls::last(), SYS_getppid);
}

// What the control thread counts.
struct Counted {
  std::atomic<std::uint64_t> cycles{0}, moving{0};
  std::atomic<bool> system_calls{false};
};

// Runs cycles as fast as possible on an arm that follows at once.
void runCycles(ControllerManager& manager, const std::atomic<bool>& stop, Counted& counted) {
  RobotSample sample;
  sample.position = kHome;
  sample.commanded_position = sample.position;
  sample.cycle_time = 0.005;
  sample.block = coglab_rt::MotionBlock::None;
  VelocityCommand command;
  counted.system_calls = SystemCalls::enable();
  while (!stop) {
    ++sample.sequence;
    sample.stamp_ns = manager.now_ns();
    counting = true;
    SystemCalls::start();
    manager.cycle().run(sample, 0.005, command);
    SystemCalls::stop();
    counting = false;
    if (command.velocity.norm() > 1e-3) ++counted.moving;
    sample.position += 0.005 * command.velocity;
    sample.velocity = command.velocity;
    sample.commanded_velocity = command.velocity;
    sample.commanded_position = sample.position;
    ++counted.cycles;
    if (counted.cycles % 16 == 0) std::this_thread::yield();
  }
}

// All requests of services, goals and publishers to the manager during the cycles.
struct Requests {
  ControllerManager& manager;
  FrameTable& frames;
  DmpController& dmp;
  PtpController& ptp;
  StreamController& twists;
  StreamController& joints;
  StreamController& poses;
  JointTrajectory& trajectory;
  int made = 0, accepted = 0, paths = 0, streamed = 0, followed = 0;

  void count(bool success) {
    ++made;
    if (success) ++accepted;
  }

  /// A message of each robot signal, and a look at the references.
  void signals() {
    FeedbackStage& stage = manager.feedbackStage();
    const double numbers[3] = {1.0, 2.0, 3.0};
    SignalMessage message;
    message.fields.resize(3, {numbers, 3});
    for (std::size_t row = 0; row < stage.signals().rows().size(); ++row) {
      message.stamp_ns = manager.now_ns();
      count(stage.signals().post(row, message, message.stamp_ns).refusal == SignalRefusal::None);
    }
    FeedbackStage::Snapshot references;
    count(stage.readReferences(references));
  }

  void round(int number) {
    std::string type;
    signals();
    GoalObservation goal;
    goal.position = Vector3(0.80, 0.02 * (number % 5), 0.45);
    goal.stamp_ns = goal.frame_ns = manager.now_ns();
    frames.frames["human_hand"] = goal;
    count(manager.switchTo("dmp", type).success);
    DmpRequest request;
    request.primitive_id = "reach_human";
    request.goal_frame = "human_hand";
    request.orientation_control = number % 2 == 0;
    count(dmp.execute(request).success);
    for (int i = 0; i < 5; ++i) {
      GoalObservation& seen = frames.frames["human_hand"];
      seen.stamp_ns = seen.frame_ns = manager.now_ns();
      dmp.pollGoal();
      dmp.askPath();
      std::this_thread::sleep_for(std::chrono::microseconds(500));
    }
    request.primitive_id = "give_human";
    count(dmp.switchDmp(request).success);
    request.primitive_id = "unknown";
    count(dmp.execute(request).success);
    count(manager.setSpeedScale(0.5 + 0.5 * (number % 2)).success);
    count(manager.feedback().enable("limits").ok());
    count(manager.switchTo("ptp", type).success);
    const double turn = 0.1 * (number % 3);
    for (int i = 0; i < 3; ++i) {
      ptp.askPath();
      count(ptp.add({{-1.4 + turn, -0.6, 1.5, 1.7, 0.2, 0.2, 0.8}, {}, {}}).id >= 0);
    }
    const double speed = 0.02 * (number % 3 - 1);
    for (const auto& [id, stream, command] :
         {std::tuple("twists", &twists, std::vector<double>(6, speed)),
          std::tuple("joints", &joints, std::vector<double>(7, speed)),
          std::tuple("poses", &poses, std::vector<double>{0.7, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0})}) {
      count(manager.switchTo(id, type).success);
      count(stream->open().success);
      const bool sent = stream->send(command).success;
      count(sent);
      if (sent) ++streamed;
      std::this_thread::sleep_for(std::chrono::microseconds(500));
    }
    count(manager.switchTo("trajectory", type).success);
    JointVector to = manager.report().robot.position;
    to[0] += 0.1;
    TrajectoryRequest path;
    path.joint_names = trajectory.jointNames();
    path.points.push_back({1.0, {to.data(), to.data() + 7}, {}, {}});
    const bool follows = trajectory.follow(path).success;
    count(follows);
    if (follows) ++followed;
    std::this_thread::sleep_for(std::chrono::microseconds(500));
    count(manager.feedback().disable("limits", true).ok());
    IkDebugRecord record;
    while (dmp.readIkDebug(record)) {
    }
    EndedMotion end;
    while (ptp.readEnd(end)) {
    }
    PredictedPath predicted;
    if (dmp.readPath(predicted)) ++paths;
    if (ptp.readPath(predicted)) ++paths;
    request.primitive_id = "reach_human";
    if (dmp.predict(request, predicted).success) ++paths;  // beside the motion under way
    manager.report();
  }
};

/// A file of signals with this many rows of input and an output.
std::string signalsFile(int count) {
  const std::string path = ::testing::TempDir() + "/twenty_signals.yaml";
  std::ofstream file(path);
  file << "in:\n";
  for (int i = 0; i < count; ++i) {
    file << "- {topic: imu" << i << ", type: sensor_msgs/Imu, field: angular_velocity, key: imu"
         << i << ", max_age: 0.002}\n";
  }
  file << "out:\n- {topic: o, type: std_msgs/Float64MultiArray, value: "
          "taskSpaceReferencePose/ee}\n";
  return path;
}

TEST(Cycle, NeitherAllocatesNorLocksWhileServicesAreCalled) {
  constexpr std::uint64_t kCycles = 100000;
  const auto limits =
      coglab_rt::loadJointLimits(std::string(DESCRIPTION_DIR) + "/config/joint_limits.yaml");
  ctrl_more::Logger logger;
  FrameTable frames;
  ManagerSettings settings = readManagerSettings(
      YAML::Load("dmp: {enable_ik_debug: true}"),
      readText(std::string(DESCRIPTION_DIR) + "/urdf/lwr_ih2.urdf"), limits, false);
  settings.logger = &logger;
  settings.cycle.overrun_time = 10.0;  // timed, and never over on a busy machine
  settings.plan_timeout = 5.0;
  settings.signals_file = signalsFile(20);
  ControllerManager manager(std::move(settings));
  std::atomic<bool> stop{false};
  Counted counted;
  const std::uint64_t calls_before = SystemCalls::count();
  ASSERT_EQ(manager.feedbackStage().signals().rows().size(), 20u);
  ASSERT_TRUE(manager.load("limits", "JointLimits").success);

  std::thread control([&] { runCycles(manager, stop, counted); });

  ASSERT_TRUE(VirtualRobot::ok(manager.load("dmp", "coglab/DmpController")));
  ASSERT_TRUE(VirtualRobot::ok(manager.load("ptp", "coglab/PtpController")));
  auto& dmp = dynamic_cast<DmpController&>(*manager.motion("dmp"));
  auto& ptp = dynamic_cast<PtpController&>(*manager.motion("ptp"));
  ASSERT_TRUE(VirtualRobot::ok(manager.load("twists", "coglab/TwistStream")));
  ASSERT_TRUE(VirtualRobot::ok(manager.load("joints", "coglab/JointVelocityStream")));
  ASSERT_TRUE(VirtualRobot::ok(manager.load("poses", "coglab/PoseStream")));
  ASSERT_TRUE(VirtualRobot::ok(manager.load("trajectory", "coglab/JointTrajectory")));
  auto& twists = dynamic_cast<StreamController&>(*manager.motion("twists"));
  auto& joints = dynamic_cast<StreamController&>(*manager.motion("joints"));
  auto& poses = dynamic_cast<StreamController&>(*manager.motion("poses"));
  auto& trajectory = dynamic_cast<JointTrajectory&>(*manager.motion("trajectory"));
  dmp.setGoalSource(&frames);
  int loaded = 0;
  ASSERT_TRUE(
      VirtualRobot::ok(dmp.loadDmps(std::string(PACKAGE_DIR) + "/config/primitives.xml", loaded)));
  Requests requests{manager, frames, dmp, ptp, twists, joints, poses, trajectory};
  for (int round = 0; counted.cycles < kCycles || round < 30; ++round) requests.round(round);
  stop = true;
  control.join();
  EXPECT_GE(counted.cycles.load(), kCycles);
  EXPECT_GT(counted.moving.load(), kCycles / 100);
  EXPECT_GT(requests.made, 300);
  EXPECT_GT(requests.accepted, requests.made / 2);
  EXPECT_GT(requests.paths, 20);
  EXPECT_GT(requests.streamed, 20);
  EXPECT_GT(requests.followed, 10);
  EXPECT_EQ(allocations.load(), 0u);
  EXPECT_EQ(locks.load(), 0u);
  const auto calls = static_cast<int>(SystemCalls::count() - calls_before);
  if (counted.system_calls) {
    EXPECT_EQ(calls, 0) << "the last one has number " << SystemCalls::last();
  }
  RecordProperty("requests", requests.made);
  RecordProperty("locks", static_cast<int>(locks.load()));
  RecordProperty("system_calls", counted.system_calls ? calls : -1);
  RecordProperty("allocations", static_cast<int>(allocations.load()));
}

TEST(Cycle, SlotsOfPythonProcessesNeitherAllocateNorLock) {
  VirtualRobot robot("plugin_paths: [" PLUGIN_DIR "]");
  // The manager itself locks in lockstep, where the caller's thread adopts requests.
  const std::uint64_t locks_at_first = locks;
  counting = true;
  robot.tick();
  counting = false;
  const std::uint64_t locks_of_lockstep = locks - locks_at_first;
  auto& motion = robot.load("python", "coglab/RemoteMotion");
  ASSERT_TRUE(VirtualRobot::ok(robot.manager->load("law", "RemoteFeedback")));
  ASSERT_TRUE(robot.manager->feedback().enable("law").ok());
  const Connection first(addressOf("python"), helloOf(RemoteKind::Motion));
  const Connection second(addressOf("law"), helloOf(RemoteKind::Feedback));
  RemoteSegment* const segments[] = {first.map(), second.map()};
  ASSERT_TRUE(segments[0] != nullptr && segments[1] != nullptr);
  const bool system_calls = SystemCalls::enable();
  const std::uint64_t calls_before = SystemCalls::count();
  const std::uint64_t allocations_before = allocations, locks_before = locks;
  int moving = 0;
  for (std::uint64_t i = 1; i <= 3000; ++i) {
    // A thread of the slot takes the process on, on a busy computer a moment later.
    for (int k = 0; i % 1000 == 1 && k < 5000 && !motion.startMotion({}).success; ++k)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    if (system_calls) SystemCalls::start();
    counting = true;
    robot.tick();
    counting = false;
    SystemCalls::stop();
    moving += robot.state() == MotionState::Running ? 1 : 0;
    if (i % 1000 > 800) continue;  // silence: it brakes, fades and ends
    for (int k = 0; k < 2; ++k) {
      RemoteQuestion question;
      std::uint64_t number = 0;
      if (!segments[k]->question.read(question, number)) continue;
      RemoteAnswer answer{};
      answer.stamp_ns = question.stamp_ns;
      answer.run = question.run;
      answer.time = question.time;
      answer.kind = k == 0 ? 1 : 3;
      if (k == 0) std::copy(question.from_joints, question.from_joints + 7, answer.values);
      answer.values[k == 0 ? 5 : 1] += 0.1 * std::sin(question.time);
      if (i % 50 == 0) answer.values[0] = std::nan("");
      segments[k]->answer.write(answer, i);
    }
  }
  EXPECT_GT(moving, 2000);
  EXPECT_EQ(allocations - allocations_before, 0u);
  EXPECT_EQ(locks - locks_before, 3000 * locks_of_lockstep);
  if (system_calls) {
    EXPECT_EQ(SystemCalls::count() - calls_before, 0u) << SystemCalls::last();
  }
}

}  // namespace
}  // namespace coglab_controllers
