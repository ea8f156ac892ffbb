// Slots with a real second process that is stopped and killed at random times. The arm is virtual;
// time advances only between two cycles.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <functional>
#include <random>
#include <string>

#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "coglab_controllers/testing/virtual_arm.hpp"
#include "remote_client.hpp"

namespace coglab_controllers {
namespace {

/// Answers of all processes so far, in memory that they share.
std::atomic<int>& answers() {
  static void* const place = ::mmap(nullptr, sizeof(std::atomic<int>), PROT_READ | PROT_WRITE,
                                    MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  return *static_cast<std::atomic<int>*>(place);
}

/// A second process that answers until it is ended.
class Process {
 public:
  using Law = void (*)(const RemoteQuestion&, RemoteAnswer&);

  Process(const std::string& id, RemoteKind kind, Law law) {
    const std::string address = addressOf(id), hello = helloOf(kind);
    answers() = 0;
    pid_ = ::fork();
    if (pid_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const Connection connection(address, hello);
    RemoteSegment* const segment = connection.map();
    std::uint64_t seen = 0;
    auto mine = static_cast<std::uint64_t>(coglab_rt::steadyNow());
    while (segment != nullptr) {
      RemoteQuestion question;
      std::uint64_t number = 0;
      if (segment->question.read(question, number) && number != seen && question.running != 0) {
        seen = number;
        RemoteAnswer answer{};
        answer.stamp_ns = question.stamp_ns;
        answer.run = question.run;
        answer.time = question.time;
        law(question, answer);
        segment->answer.write(answer, ++mine);
        ++answers();
      }
      ::usleep(100);
    }
    ::_exit(1);
  }
  ~Process() { end(); }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  void send(int signal) const { ::kill(pid_, signal); }
  void end() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  pid_t pid_ = -1;
};

/// Waits for another process or thread, at most about 20 s.
bool soon(const std::function<bool()>& happened) {
  for (int i = 0; i < 200'000; ++i) {
    if (happened()) return true;
    ::usleep(50);
  }
  return false;
}

struct Motion : ::testing::Test {
  VirtualArm arm{DESCRIPTION_DIR, "{plugin_paths: [" PLUGIN_DIR "]}"};
  CustomMotionController& motion = arm.load("python", "coglab/RemoteMotion");

  void SetUp() override { arm.followWithinLimits(); }

  /// One cycle. Checks the arm's limits.
  /// @param answered true: time stands still until the other process has answered
  void tick(bool answered = false) {
    const int before = answers();
    arm.tick();
    if (answered && arm.state() == MotionState::Running) {
      ASSERT_TRUE(soon([before] { return answers() != before; }));
    }
    for (int i = 0; i < 7; ++i) {
      ASSERT_LE(std::abs(arm.sample.commanded_velocity[i]), arm.limits.velocity[i] + 1e-9);
      ASSERT_LE(std::abs(arm.sample.commanded_acceleration[i]), arm.limits.acceleration[i] + 1e-6);
    }
  }
  bool start() {
    return soon([this] {
      if (!motion.startMotion({}).success) return false;
      tick(true);
      tick(true);
      return arm.state() == MotionState::Running;
    });
  }
};

// The sixth joint swings with 0.3 rad and reverses at its ends.
void swing(const RemoteQuestion& question, RemoteAnswer& answer) {
  answer.kind = static_cast<std::int64_t>(RemoteAnswerKind::Joints);
  for (int i = 0; i < 7; ++i) answer.values[i] = question.from_joints[i];
  const double size = question.from_joints[5] > 0.8 ? -0.3 : 0.3;
  answer.values[5] += size * (1.0 - std::cos(question.time));
  answer.values[12] = size * std::sin(question.time);
}

TEST_F(Motion, AStoppedOrDeadProcessNeverHoldsTheArm) {
  std::mt19937 random(3);
  for (int round = 0; round < 200; ++round) {
    Process process("python", RemoteKind::Motion, swing);
    ASSERT_TRUE(start()) << arm.reason();
    const int cycles = 5 + static_cast<int>(random() % 100);
    for (int i = 0; i < cycles; ++i) tick(true);
    const bool stops = round % 2 == 0;
    process.send(stops ? SIGSTOP : SIGKILL);
    int waited = 0;
    while (!(arm.state() == MotionState::Aborted && arm.manager->report().standing)) {
      tick();
      ASSERT_LT(++waited, 400);
    }
    EXPECT_EQ(arm.manager->report().reason.code(), ReasonCode::ControllerFault) << arm.reason();
    const JointVector stood = arm.sample.position;
    process.send(SIGCONT);
    for (int i = 0; i < 10; ++i) tick();
    EXPECT_LT((arm.sample.position - stood).norm(), 1e-6);
  }
}

TEST_F(Motion, FollowsWithinTheProcess) {
  Process process("python", RemoteKind::Motion, swing);
  ASSERT_TRUE(start()) << arm.reason();
  const double from = arm.sample.position[5];
  double most = 0.0;
  for (int i = 0; i < 700; ++i) {
    tick(true);
    most = std::max(most, arm.sample.position[5] - from);
  }
  EXPECT_EQ(arm.state(), MotionState::Running) << arm.reason();
  EXPECT_NEAR(most, 0.6, 0.02);
}

void nonsense(const RemoteQuestion& question, RemoteAnswer& answer) {
  answer.kind = question.cycle % 7;
  for (double& value : answer.values) value = question.cycle % 2 != 0 ? std::nan("") : 1e9;
}

TEST_F(Motion, AnswersThatAreNoNumbersEndIt) {
  Process process("python", RemoteKind::Motion, nonsense);
  ASSERT_TRUE(start()) << arm.reason();
  for (int i = 0; i < 200 && arm.state() != MotionState::Aborted; ++i) tick(true);
  EXPECT_EQ(arm.state(), MotionState::Aborted);
}

TEST_F(Motion, WithoutAProcessItEndsWithWhatToDo) {
  ASSERT_TRUE(motion.startMotion({}).success);
  for (int i = 0; i < 10; ++i) tick();
  EXPECT_EQ(arm.state(), MotionState::Aborted);
  EXPECT_NE(arm.reason().find("./coglab controller run"), std::string::npos) << arm.reason();
}

TEST_F(Motion, OtherProgramsAreRefusedWithAReason) {
  const std::string address = addressOf("python");
  const auto refusal = [&](const std::string& hello) {
    return std::string(Connection(address, hello).text);
  };
  EXPECT_NE(refusal(helloOf(RemoteKind::Motion, 7)).find("has 7"), std::string::npos);
  EXPECT_NE(refusal(helloOf(RemoteKind::Feedback)).find("for a motion"), std::string::npos);
  EXPECT_NE(refusal("GET / HTTP/1.0").find("expected the greeting"), std::string::npos);
  const Connection first(address, helloOf(RemoteKind::Motion));
  EXPECT_STREQ(first.text, "welcome");
  EXPECT_NE(refusal(helloOf(RemoteKind::Motion)).find("process " + std::to_string(::getpid())),
            std::string::npos);
  // No process can shorten the memory that the cycle uses.
  EXPECT_NE(::ftruncate(first.memory, 0), 0);
}

TEST_F(Motion, RandomBytesInTheMemoryEndItWithinLimits) {
  const Connection connection(addressOf("python"), helloOf(RemoteKind::Motion));
  auto* const bytes = reinterpret_cast<unsigned char*>(connection.map());
  ASSERT_NE(bytes, nullptr);
  ASSERT_TRUE(soon([this] { return motion.startMotion({}).success; }));
  std::mt19937 random(4);
  for (int i = 0; i < 100; ++i) {
    for (std::size_t k = 0; k < sizeof(RemoteSegment); ++k)
      bytes[k] = static_cast<unsigned char>(random());
    tick();
  }
  EXPECT_EQ(arm.state(), MotionState::Aborted);
  ::munmap(bytes, sizeof(RemoteSegment));
}

struct Feedback : ::testing::Test {
  VirtualArm arm{DESCRIPTION_DIR, "{plugin_paths: [" PLUGIN_DIR "]}"};
  Vector3 home, before;

  void SetUp() override {
    arm.load("python_motion", "coglab/RemoteMotion");  // it holds the arm
    const Answer loaded = arm.manager->load("law", "RemoteFeedback");
    ASSERT_TRUE(loaded.success) << loaded.message;
    ASSERT_TRUE(arm.manager->feedback().enable("law").ok());
    for (int i = 0; i < 100; ++i) arm.tick();
    home = before = arm.hand().position;
  }
  void tick(bool answered = false) {
    const int count = answers();
    arm.tick();
    if (answered) {
      ASSERT_TRUE(soon([count] { return answers() != count; }));
    }
    const Vector3 at = arm.hand().position;
    // 0.2 m/s is the rate; the arm's own loop swings a little around it.
    ASSERT_LE((at - before).norm(), 0.005 * 0.25);
    ASSERT_LE((at - home).norm(), 0.051);
    before = at;
  }
  double away() const { return (arm.hand().position - home).norm(); }
};

void shift(const RemoteQuestion& question, RemoteAnswer& answer) {
  answer.kind = static_cast<std::int64_t>(RemoteAnswerKind::Correction);
  answer.values[2] = question.cycle / 20 % 2 == 0 ? 0.2 : -0.2;  // beyond its bound
  answer.values[1] = 0.02;
}

TEST_F(Feedback, TheCorrectionOfAStoppedOrDeadProcessFades) {
  std::mt19937 random(5);
  for (int round = 0; round < 200; ++round) {
    Process process("law", RemoteKind::Feedback, shift);
    ASSERT_TRUE(soon([this] { return tick(answers() > 0), away() > 0.005; }));
    const int cycles = static_cast<int>(random() % 50);
    for (int i = 0; i < cycles; ++i) tick(true);
    process.send(round % 2 == 0 ? SIGSTOP : SIGKILL);
    for (int i = 0; i < 140; ++i) tick();  // max_age, fade_time, and the arm that follows
    EXPECT_LT(away(), 1e-3);
  }
}

TEST_F(Feedback, AStoppedArmStandsAndTheCorrectionComesBackAfterReset) {
  const Process process("law", RemoteKind::Feedback,
                        [](const RemoteQuestion&, RemoteAnswer& answer) {
                          answer.kind = static_cast<std::int64_t>(RemoteAnswerKind::Correction);
                          answer.values[2] = 0.03;
                        });
  ASSERT_TRUE(soon([this] { return tick(answers() > 0), away() > 0.029; }));
  const auto block = [this](MotionBlock why) {
    arm.sample.block = why;
    ++arm.sample.motion_epoch;
  };
  block(MotionBlock::Held);
  for (int i = 0; i < 4; ++i) tick();
  const JointVector stopped = arm.sample.position;
  for (int i = 0; i < 100; ++i) {
    tick();
    ASSERT_TRUE(arm.manager->report().standing);
  }
  EXPECT_EQ(arm.sample.position, stopped);
  block(MotionBlock::None);
  home = arm.hand().position;  // it holds where it stands
  double fastest = 0.0;
  ASSERT_TRUE(soon([&] {
    const int count = answers();
    arm.tick();
    EXPECT_TRUE(soon([count] { return answers() != count; }));
    fastest = std::max(fastest, arm.handVelocity().norm());
    return away() > 0.029;
  }));
  EXPECT_LT(fastest, 0.4) << "its rate of 0.2 m/s, and the blending";
}

/// Valid at first, then invalid corrections: a wrong kind, NaN, and numbers beyond any reach.
void spoilt(const RemoteQuestion& question, RemoteAnswer& answer) {
  shift(question, answer);
  if (answers() < 40) return;
  if (question.cycle % 3 == 0) answer.kind = static_cast<std::int64_t>(RemoteAnswerKind::Joints);
  answer.values[question.cycle % 3] = question.cycle % 2 == 0 ? std::nan("") : 1e9;
}

TEST_F(Feedback, AnswersThatAreNoCorrectionsFade) {
  const Process process("law", RemoteKind::Feedback, spoilt);
  ASSERT_TRUE(soon([this] { return tick(answers() > 0), away() > 0.005; }));
  for (int i = 0; i < 180; ++i) tick(true);
  EXPECT_LT(away(), 1e-3);
}

void givesUp(const RemoteQuestion& question, RemoteAnswer& answer) {
  shift(question, answer);
  if (answers() >= 40) answer.kind = static_cast<std::int64_t>(RemoteAnswerKind::GiveUp);
}

TEST_F(Feedback, TheCorrectionOfAControllerThatGaveUpFades) {
  const Process process("law", RemoteKind::Feedback, givesUp);
  ASSERT_TRUE(soon([this] { return tick(answers() > 0), away() > 0.005; }));
  for (int i = 0; i < 180; ++i) tick(true);
  EXPECT_LT(away(), 1e-3);
}

}  // namespace
}  // namespace coglab_controllers
