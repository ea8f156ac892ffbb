/// The supervisor alone: order of the reasons, reported state, and end of a permission.
#include <gtest/gtest.h>

#include "lwr_fri_bridge/supervision/supervisor.hpp"

namespace lwr_fri_bridge {
namespace {

/// A controller in command mode with power, an arm that stands.
SupervisorInput ready() {
  SupervisorInput input;
  input.connected = input.command_mode = input.full_power = input.stands_still = true;
  return input;
}

/// Started, and one tick later.
struct Started : Supervisor {
  Started() {
    startBegins();
    startEnds(true);
    update(ready());
  }
};

/// Of several reasons, the one that must be removed first is reported.
TEST(Supervisor, ReasonsCountInTheirOrder) {
  struct Row {
    MotionBlock block;
    void (*set)(Started&, SupervisorInput&);
  };
  const Row rows[] = {
      {MotionBlock::Disconnected, [](Started&, SupervisorInput& i) { i.connected = false; }},
      {MotionBlock::Stopping, [](Started& s, SupervisorInput&) { s.stopBegins(); }},
      {MotionBlock::Held, [](Started& s, SupervisorInput&) { s.hold(); }},
      {MotionBlock::Monitor, [](Started&, SupervisorInput& i) { i.command_mode = false; }},
      {MotionBlock::DriveError, [](Started&, SupervisorInput& i) { i.drive_error = true; }},
      {MotionBlock::PoorQuality,
       [](Started&, SupervisorInput& i) { i.quality_unacceptable = true; }},
      {MotionBlock::NoPower, [](Started&, SupervisorInput& i) { i.full_power = false; }},
      {MotionBlock::Leashed, [](Started&, SupervisorInput& i) { i.leashed = true; }},
  };
  constexpr int kRows = sizeof rows / sizeof rows[0];
  for (int first = 0; first < kRows; ++first) {
    for (int also = first; also < kRows; ++also) {
      Started supervisor;
      SupervisorInput input = ready();
      rows[first].set(supervisor, input);
      rows[also].set(supervisor, input);
      supervisor.update(input);
      EXPECT_EQ(supervisor.block(), rows[first].block) << first << " " << also;
      EXPECT_EQ(supervisor.epoch(), 2U) << first << " " << also;
    }
  }
}

/// A loss after the start needs a new start; a leash does not.
TEST(Supervisor, ALossNeedsAStartAndIsCounted) {
  struct Row {
    bool SupervisorInput::*what;
    bool value;
    MotionBlock afterwards;  // when the cause has gone
  };
  for (const Row& row :
       {Row{&SupervisorInput::connected, false, MotionBlock::NotStarted},
        Row{&SupervisorInput::command_mode, false, MotionBlock::NotStarted},
        Row{&SupervisorInput::full_power, false, MotionBlock::NotStarted},
        Row{&SupervisorInput::fresh_session, true, MotionBlock::NotStarted},
        Row{&SupervisorInput::quality_unacceptable, true, MotionBlock::PoorQuality},
        Row{&SupervisorInput::drive_error, true, MotionBlock::DriveError}}) {
    Started supervisor;
    SupervisorInput input = ready();
    input.*row.what = row.value;
    supervisor.update(input);
    supervisor.update(input);
    EXPECT_EQ(supervisor.fallBacks(), 1U);
    supervisor.update(ready());
    EXPECT_EQ(supervisor.state(), SupervisorState::Stopped);
    EXPECT_EQ(supervisor.block(), row.afterwards);
    SupervisorInput monitor = ready();
    monitor.command_mode = false;
    supervisor.update(monitor);
    EXPECT_EQ(supervisor.state(), SupervisorState::Stopped);  // it latches
    supervisor.startBegins();
    supervisor.update(ready());
    EXPECT_EQ(supervisor.block(), MotionBlock::NotStarted);
    supervisor.startEnds(true);
    supervisor.update(ready());
    EXPECT_EQ(supervisor.state(), SupervisorState::Command);
    EXPECT_EQ(supervisor.fallBacks(), 1U);
  }
  Started leashed;
  SupervisorInput input = ready();
  input.leashed = true;
  leashed.update(input);
  leashed.update(ready());
  EXPECT_EQ(leashed.block(), MotionBlock::None);
  EXPECT_EQ(leashed.fallBacks(), 0U);
  EXPECT_EQ(leashed.epoch(), 3U);
}

}  // namespace
}  // namespace lwr_fri_bridge
