// Records in shared memory: whole, or refused.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <thread>

#include "coglab_controllers/remote/bounded.hpp"
#include "coglab_controllers/remote/layout.hpp"

namespace coglab_controllers {
namespace {

TEST(SharedRecord, NoHalfWrittenAnswerIsAccepted) {
  auto record = std::make_unique<SharedRecord<RemoteAnswer>>();
  std::atomic<bool> ended{false};
  std::thread writer([&] {
    RemoteAnswer answer{};
    for (std::uint64_t number = 1; number <= 200'000; ++number) {
      for (double& value : answer.values) value = static_cast<double>(number);
      record->write(answer, number);
    }
    ended = true;
  });
  while (!ended) {
    RemoteAnswer answer{};
    std::uint64_t number = 0;
    if (!record->read(answer, number)) continue;
    for (const double value : answer.values) ASSERT_EQ(value, static_cast<double>(number));
  }
  writer.join();
}

TEST(SharedRecord, EmptyMemoryAndRandomBytesAreRefused) {
  alignas(64) unsigned char memory[sizeof(SharedRecord<RemoteAnswer>)] = {};
  auto* const record = reinterpret_cast<SharedRecord<RemoteAnswer>*>(memory);
  RemoteAnswer answer{};
  std::uint64_t number = 0;
  EXPECT_FALSE(record->read(answer, number));
  std::mt19937 random(1);
  for (int i = 0; i < 10'000; ++i) {
    for (unsigned char& byte : memory) byte = static_cast<unsigned char>(random());
    ASSERT_FALSE(record->read(answer, number));
  }
}

TEST(BoundedCorrection, FadesWithinItsTimeAndNeverFasterThanItsRate) {
  constexpr double kDt = 0.005;
  BoundedCorrection correction;
  correction.setBounds(0.05, 0.2, 0.5);
  Eigen::Vector3d before = correction.at();
  const auto check = [&] {
    EXPECT_LE((correction.at() - before).norm(), 0.2 * kDt + 1e-12);
    EXPECT_LE(correction.at().norm(), 0.05 + 1e-12);
    before = correction.at();
  };
  for (int i = 0; i < 100; ++i) correction.follow({9.0, -3.0, 1.0}, kDt), check();
  EXPECT_NEAR(correction.at().norm(), 0.05, 1e-9);
  for (int i = 0; i < 101; ++i) correction.fade(kDt), check();
  EXPECT_EQ(correction.at(), Eigen::Vector3d(0, 0, 0));
}

TEST(BoundedFollower, KeepsItsBoundsWhateverComesAndArrivesWithoutOvershoot) {
  constexpr double kDt = 0.005;
  using Follower = BoundedFollower<1>;
  Follower follower;
  follower.setBounds(Follower::Vector(1.0), Follower::Vector(3.0));
  std::mt19937 random(2);
  std::uniform_real_distribution<double> any(-5.0, 5.0);
  double before = 0.0;
  const auto check = [&] {
    EXPECT_LE(std::abs(follower.velocity()[0]), 1.0 + 1e-12);
    EXPECT_LE(std::abs(follower.velocity()[0] - before), 3.0 * kDt + 1e-12);
    before = follower.velocity()[0];
    follower.advance();
  };
  for (int i = 0; i < 1000; ++i) {
    follower.follow(Follower::Vector(any(random)), Follower::Vector(any(random)), kDt);
    check();
  }
  while (std::abs(follower.velocity()[0]) > 0.0) follower.brake(kDt), check();
  const double goal = follower.at()[0] + 1.0;
  for (int i = 0; i < 600; ++i) {
    follower.follow(Follower::Vector(goal), Follower::Vector(0.0), kDt);
    check();
    EXPECT_LE(follower.at()[0], goal + 1e-3);
  }
  EXPECT_NEAR(follower.at()[0], goal, 1e-3);
}

}  // namespace
}  // namespace coglab_controllers
