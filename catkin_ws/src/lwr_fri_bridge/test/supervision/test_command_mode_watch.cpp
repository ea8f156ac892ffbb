/// Limits of lateness, loss and rest before a loss of command mode, the texts of the causes, and
/// the conditions of a restart, without a bridge.
#include <gtest/gtest.h>

#include "lwr_fri_bridge/supervision/command_mode_loss.hpp"

namespace lwr_fri_bridge {
namespace {

constexpr std::int64_t kMs = 1'000'000, kSecond = 1'000 * kMs;

CommandModeWatch::Facts leftByItself() {
  CommandModeWatch::Facts facts;
  facts.connected = true;
  facts.cycle_time = 0.005;
  return facts;
}

LossCause causeAfter(double late, double then_seconds = 0.0) {
  CommandModeWatch watch;
  watch.late(late);
  if (then_seconds > 0.0) watch.tick(then_seconds, 0, 0.0, 0.0);
  return watch.judge(leftByItself()).cause;
}

TEST(CommandModeWatch, MoreThanThreeCyclesOfLatenessCount) {
  EXPECT_EQ(causeAfter(0.0), LossCause::LeftByController);
  EXPECT_EQ(causeAfter(0.0149), LossCause::LeftByController);
  EXPECT_EQ(causeAfter(0.0151), LossCause::ComputerLate);
  EXPECT_EQ(causeAfter(0.040, 0.9), LossCause::ComputerLate);      // 16.3 ms are left after 0.9 s
  EXPECT_EQ(causeAfter(0.040, 1.0), LossCause::LeftByController);  // 14.7 ms after a second
  CommandModeWatch twice;
  twice.late(0.008);
  twice.late(0.008);
  const CommandModeLoss loss = twice.judge(leftByItself());
  EXPECT_EQ(loss.cause, LossCause::ComputerLate);
  EXPECT_DOUBLE_EQ(loss.seconds, 0.016);
}

TEST(CommandModeWatch, ThreeLostPacketsCount) {
  const auto cause = [](std::uint32_t first, double pause, std::uint32_t second) {
    CommandModeWatch watch;
    watch.tick(0.005, first, 0.0, 0.0);
    watch.tick(pause, second, 0.0, 0.0);
    return watch.judge(leftByItself()).cause;
  };
  EXPECT_EQ(cause(0, 0.005, 2), LossCause::LeftByController);
  EXPECT_EQ(cause(0, 0.005, 3), LossCause::PacketsLost);
  EXPECT_EQ(cause(2, 0.005, 2), LossCause::PacketsLost);
  EXPECT_EQ(cause(2, 1.4, 2), LossCause::LeftByController);  // 2.49
  EXPECT_EQ(cause(2, 1.3, 2), LossCause::PacketsLost);       // 2.55
}

TEST(CommandModeWatch, RestIsHalfASecondOfCommandedAndMeasuredStandstill) {
  const auto rested = [](double measured, double commanded, double seconds) {
    CommandModeWatch watch;
    watch.tick(seconds, 0, measured, commanded);
    return watch.judge(leftByItself()).at_rest;
  };
  EXPECT_FALSE(rested(0.0, 0.0, 0.49));
  EXPECT_TRUE(rested(0.0, 0.0, 0.5));
  EXPECT_TRUE(rested(0.019, 0.019, 0.5));
  EXPECT_FALSE(rested(0.021, 0.0, 5.0));
  EXPECT_FALSE(rested(0.0, 0.021, 5.0));
  EXPECT_FALSE(rested(0.02, 0.0, 5.0));
  EXPECT_FALSE(rested(0.0, 0.02, 5.0));
  CommandModeWatch watch;
  EXPECT_FALSE(watch.judge(leftByItself()).at_rest);
  watch.tick(0.25, 0, 0.0, 0.0);
  watch.tick(0.25, 0, 0.0, 0.0);
  EXPECT_TRUE(watch.judge(leftByItself()).at_rest);
  watch.tick(0.005, 0, 0.5, 0.5);
  watch.tick(0.25, 0, 0.0, 0.0);
  EXPECT_FALSE(watch.judge(leftByItself()).at_rest);  // from the motion on
}

TEST(CommandModeWatch, CertainCausesComeBeforeLikelyOnes) {
  CommandModeWatch watch;
  watch.late(1.0);
  watch.tick(0.005, 9, 0.0, 0.0);
  CommandModeWatch::Facts facts = leftByItself();
  facts.timestamp = 12.5F;
  facts.position = Vector7::LinSpaced(0.1, 0.7);
  EXPECT_EQ(watch.judge(facts).cause, LossCause::ComputerLate);
  facts.command_mode = true;
  EXPECT_EQ(watch.judge(facts).cause, LossCause::PowerLost);
  facts.fresh_session = true;
  const CommandModeLoss loss = watch.judge(facts);
  EXPECT_EQ(loss.cause, LossCause::BeganAnew);
  EXPECT_EQ(loss.timestamp, 12.5F);
  EXPECT_EQ(loss.position, facts.position);
}

/// View of an arm that stood when this computer was late, and has stood since.
QuietRestart::View calm(float lost_at = 10.0F) {
  QuietRestart::View view;
  view.loss.cause = LossCause::ComputerLate;
  view.loss.at_rest = true;
  view.loss.timestamp = lost_at;
  view.stopped = view.may_command = true;
  view.timestamp = lost_at + 0.5F;
  return view;
}

TEST(QuietRestart, IsDueAfterATenthOfASecondOfCalm) {
  QuietRestart restart;
  EXPECT_FALSE(restart.due(calm(), 5 * kSecond));
  EXPECT_FALSE(restart.due(calm(), 5 * kSecond + 99 * kMs));
  EXPECT_TRUE(restart.due(calm(), 5 * kSecond + 101 * kMs));
  EXPECT_FALSE(restart.due(calm(), 6 * kSecond));  // once for each loss
  EXPECT_FALSE(restart.due(calm(), 70 * kSecond));
  EXPECT_FALSE(restart.due(calm(20.0F), 71 * kSecond));  // the calm begins anew
  EXPECT_FALSE(restart.due(calm(20.0F), 71 * kSecond + 99 * kMs));
  QuietRestart::View moving = calm(20.0F);
  moving.velocity[3] = 0.5;
  EXPECT_FALSE(restart.due(moving, 71 * kSecond + 100 * kMs));
  EXPECT_FALSE(restart.due(calm(20.0F), 71 * kSecond + 110 * kMs));
  EXPECT_FALSE(restart.due(calm(20.0F), 71 * kSecond + 209 * kMs));
  EXPECT_TRUE(restart.due(calm(20.0F), 71 * kSecond + 211 * kMs));
}

TEST(QuietRestart, EveryConditionIsNeeded) {
  const auto due = [](auto change) {
    QuietRestart restart;
    QuietRestart::View view = calm();
    change(view);
    restart.due(view, 5 * kSecond);
    return restart.due(view, 6 * kSecond);
  };
  using View = QuietRestart::View;
  EXPECT_TRUE(due([](View&) {}));
  EXPECT_TRUE(due([](View& v) { v.loss.cause = LossCause::ControllerStalled; }));
  EXPECT_FALSE(due([](View& v) { v.stopped = false; }));
  EXPECT_FALSE(due([](View& v) { v.held = true; }));
  EXPECT_FALSE(due([](View& v) { v.may_command = false; }));
  EXPECT_FALSE(due([](View& v) { v.loss.cause = LossCause::ControllerSilent; }));
  EXPECT_FALSE(due([](View& v) { v.loss.at_rest = false; }));
  EXPECT_FALSE(due([](View& v) { v.timestamp = v.loss.timestamp; }));
  for (const int joint : {0, 6}) {
    for (const double sign : {-1.0, 1.0}) {
      EXPECT_TRUE(due([&](View& v) { v.position[joint] = sign * 0.0019; }));
      EXPECT_FALSE(due([&](View& v) { v.position[joint] = sign * 0.0021; }));
      EXPECT_TRUE(due([&](View& v) { v.velocity[joint] = sign * 0.019; }));
      EXPECT_FALSE(due([&](View& v) { v.velocity[joint] = sign * 0.021; }));
    }
  }
  EXPECT_TRUE(due([](View& v) { v.position = v.loss.position = Vector7::Constant(1.0); }));
}

TEST(QuietRestart, NoMoreThanThreeInAMinute) {
  QuietRestart restart;
  float loss = 10.0F;
  const auto due = [&](std::int64_t at_ns) {
    restart.due(calm(loss), at_ns - 200 * kMs);
    const bool yes = restart.due(calm(loss), at_ns);
    if (yes) loss += 1.0F;
    return yes;
  };
  EXPECT_TRUE(due(10 * kSecond));
  EXPECT_TRUE(due(20 * kSecond));
  EXPECT_TRUE(due(30 * kSecond));
  EXPECT_FALSE(due(40 * kSecond));
  EXPECT_FALSE(due(70 * kSecond - 1));
  EXPECT_TRUE(due(70 * kSecond));  // a minute after the first of the three
  EXPECT_FALSE(due(79 * kSecond));
  EXPECT_TRUE(due(80 * kSecond));
}

}  // namespace
}  // namespace lwr_fri_bridge
