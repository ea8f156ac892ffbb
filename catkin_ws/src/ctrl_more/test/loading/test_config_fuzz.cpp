// Any file is either accepted completely or refused with a message, as a list, as gains and as a
// configuration. The running controller continues.
#include <array>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <utility>

#include <unistd.h>

#include "test_support.hpp"

namespace ctrl_more {
namespace {

std::string mutate(const std::string& seed, std::mt19937& random) {
  static const std::string kPieces[] = {":",  "- ", "[",    "]",   "{",        "}",   "&a ",  "*a",
                                        "!!", "|",  ">",    "#",   "\n",       "\t",  "\"",   "'",
                                        "?",  ",",  ".nan", "1e9", "-1",       "~",   "null", "0x1",
                                        "%",  "@",  "---",  "...", "\xff\xfe", "<<:", "type", "  "};
  std::string text = seed;
  const int changes = 1 + static_cast<int>(random() % 6);
  for (int i = 0; i < changes; ++i) {
    const std::size_t at = text.empty() ? 0 : random() % text.size();
    switch (random() % 6) {
      case 0:
        text.insert(at, kPieces[random() % std::size(kPieces)]);
        break;
      case 1:
        text.erase(at, 1 + random() % 8);
        break;
      case 2:
        if (!text.empty()) text[at] = static_cast<char>(random() % 256);
        break;
      case 3:
        text.insert(at, text.substr(at, random() % 30));
        break;
      case 4:
        text = text.substr(0, at);
        break;
      case 5: {
        const std::size_t other = text.empty() ? 0 : random() % text.size();
        if (!text.empty()) std::swap(text[at], text[other]);
      }
    }
  }
  return text;
}

/// Replaces one word or number of a file by another plausible one, like a typing error.
std::string mistype(const std::string& seed, std::mt19937& random) {
  static const std::string kWords[] = {"0",    "1",    "2",     "0.5",     "-0.1", "2.001", "1e-3",
                                       "true", "fast", "slow",  "running", "Good", "kp",    "mode",
                                       "[]",   "hold", "faded", "Godo",    ".inf", "''",    "3"};
  std::vector<std::pair<std::size_t, std::size_t>> places;  // begin and length of each word
  for (std::size_t i = 0; i < seed.size();) {
    std::size_t end = i;
    while (end < seed.size() && (std::isalnum(static_cast<unsigned char>(seed[end])) != 0 ||
                                 std::strchr("._/-", seed[end]) != nullptr))
      ++end;
    if (end > i) places.emplace_back(i, end - i);
    i = end + 1;
  }
  const auto& [begin, length] = places[random() % places.size()];
  std::string text = seed;
  return text.replace(begin, length, kWords[random() % std::size(kWords)]);
}

std::unique_ptr<TestController> configurable() {
  auto c = adder("pose", "ee", 1.0);
  c->description.gain("kp", 0).vector(3, 1.0).range(0, 2).in("1").about("x");
  c->description.gain("max_angle", 1.0).range(0, 2).in("rad").about("x");
  c->description.setting("mode", "fast").oneOf({"fast", "slow"}).about("x");
  return c;
}

const std::string kGains =
    "type: TestController\nkp: [0.1, 0.2, 0.3]\nmax_angle: 0.5\nmode: fast\n";
const std::string kList =
    "loadControllers: [listed]\nlisted:\n  libPath: " CTRL_MORE_TEST_PLUGIN_DIR
    "/libgood.so\n  configFile: good.yaml\n  enabled: false\n"
    "  overrun_us: 100\n  blend_s: 0.1\nprofiles:\n  dmp: [running]\n";

enum Way { kAsList, kAsGains, kAsConfiguration, kWays };

/// State that a refused load must not change.
struct Snapshot {
  std::vector<std::string> names, order, profiles;
  GainValues gains;
  bool enabled, paused;

  explicit Snapshot(const FeedbackControllersManager& manager)
      : names(manager.getControllersNames()),
        order(manager.getExecutionOrder()),
        profiles(manager.getProfiles()),
        gains(manager.getGains("running")),
        enabled(manager.isEnabled("running")),
        paused(manager.isPaused("running")) {}
  bool operator==(const Snapshot& other) const {
    return names == other.names && order == other.order && profiles == other.profiles &&
           gains.sameAs(other.gains) && enabled == other.enabled && paused == other.paused;
  }
};

/// A running controller, and files that are loaded in every way.
class ConfigFuzz : public ::testing::Test {
 protected:
  void SetUp() override {
    rig_.logger.setLevel(LogLevel::Error);
    running_ = rig_.add(configurable(), "running");
    // In memory if possible, because a hundred thousand files would wear a disk.
    folder_ = access("/dev/shm", W_OK) == 0 ? "/dev/shm" : ::testing::TempDir();
    folder_ += "/ctrl_more_fuzz_XXXXXX";
    ASSERT_NE(mkdtemp(&folder_[0]), nullptr) << folder_;
    file_ = folder_ + "/fuzz.yaml";
    std::ofstream(folder_ + "/good.yaml") << "type: Good\n";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// Writes a file and loads it in each way, first in the intended one.
  void loadInEveryWay(const std::string& text, Way own) {
    {
      std::ofstream out(file_, std::ios::binary);
      out << text;
      ASSERT_TRUE(out.flush().good());
    }
    bool taken[kWays] = {};
    std::string refusal[kWays];
    GainValues as_gains, as_configuration;
    for (int turn = 0; turn < kWays; ++turn) {
      const Way way = static_cast<Way>((own + turn) % kWays);
      const Snapshot before(*rig_.manager);
      refusal[way] = load(way);
      taken[way] = refusal[way].empty();
      ++(taken[way] ? taken_ : refused_)[way];
      if (turn == 0) ++(taken[way] ? own_taken_ : own_refused_)[way];
      if (!taken[way]) {
        ASSERT_TRUE(before == Snapshot(*rig_.manager)) << way << ": half of it stayed";
      }
      if (taken[way] && way == kAsGains) as_gains = rig_.manager->getGains("running");
      if (taken[way] && way == kAsConfiguration) {
        ASSERT_TRUE(rig_.manager->has("configured"));
        as_configuration = rig_.manager->getGains("configured");
      }
      ASSERT_NO_FATAL_FAILURE(look(way));
      ASSERT_NO_FATAL_FAILURE(unloadTheRest());
    }
    // Gains and configuration are the same file: both have the same numbers of it, and what only
    // a new controller takes has another setting.
    if (taken[kAsGains]) {
      ASSERT_TRUE(taken[kAsConfiguration]) << refusal[kAsConfiguration];
      ASSERT_TRUE(as_gains.sameAs(as_configuration));
    } else if (taken[kAsConfiguration]) {
      ASSERT_TRUE(contains(refusal[kAsGains], "setting 'mode'")) << refusal[kAsGains];
    }
  }

  std::array<long, kWays> taken_{}, refused_{}, own_taken_{}, own_refused_{};
  long looks_ = 0;

 private:
  /// Loads the file. Returns the error message; empty if it was accepted.
  std::string load(Way way) {
    if (way == kAsList) {
      const LoadReport report = rig_.manager->load(file_);
      for (const std::string& error : report.errors) EXPECT_FALSE(error.empty());
      EXPECT_TRUE(report.ok() || report.loaded.empty()) << "nothing of a list that is refused";
      for (const std::string& name : report.loaded) EXPECT_TRUE(rig_.manager->has(name)) << name;
      EXPECT_EQ(rig_.manager->getControllersNames().size(), 1 + report.loaded.size());
      return report.ok() ? "" : report.errors.front();
    }
    Status status;
    if (way == kAsGains) {
      status = rig_.manager->loadGains("running", file_);
    } else {
      ControllerEntry entry;
      entry.config_file = file_;
      status = rig_.manager->addController(configurable(), "configured", entry);
    }
    EXPECT_TRUE(status.ok() || !status.message().empty());
    return status ? "" : status.message();
  }

  /// Checks that the running controller continues: one more update, and its correction.
  void look(Way way) {
    const int updates = running_->updates;
    rig_.step();
    ASSERT_EQ(running_->updates, updates + 1) << way;
    ASSERT_EQ(rig_.pose()[0], 1.0) << way;
    ++looks_;
  }

  /// Removes the loaded controllers, so that the next file finds the same state.
  void unloadTheRest() {
    const std::vector<std::string> names = rig_.manager->getControllersNames();
    if (names.size() == 1) return;
    for (const std::string& profile : rig_.manager->getProfiles()) {
      ASSERT_TRUE(rig_.manager->setProfile(profile, {"running"}));
    }
    for (const std::string& name : names) {
      if (name == "running") continue;
      rig_.manager->disable(name, true);
      Status gone = Status::failure("not tried");
      for (int cycle = 0; cycle < 1000 && !gone; ++cycle) {  // until its correction has faded
        rig_.step();
        gone = rig_.manager->unload(name);
      }
      ASSERT_TRUE(gone) << gone.message();
    }
  }

  Rig rig_{0.0, false, false};
  TestController* running_ = nullptr;
  std::string folder_, file_;
};

/// Number of files from the environment; the bench sets more than the default of the tests.
long filesAskedFor() {
  const char* const asked = std::getenv("CTRL_MORE_FUZZ_FILES");
  return asked == nullptr ? 12000 : std::atol(asked);
}

/// Every file is written, and loaded as list, as gains of a controller that runs, and as the
/// configuration of a new one; a third of them is meant for each, and half of them differ from a
/// good one by one word. What runs is looked at after each load.
TEST_F(ConfigFuzz, DamagedFilesNeverAffectRunningControllers) {
  const long files = filesAskedFor();
  ASSERT_GE(files, 1200) << "CTRL_MORE_FUZZ_FILES";
  long mistyped = 0;
  std::mt19937 random(20180521);
  for (long i = 0; i < files; ++i) {
    const Way own = static_cast<Way>(i % kWays);
    const std::string& good = own == kAsList ? kList : kGains;
    const bool near = (i / kWays) % 2 != 0;
    const std::string text = near ? mistype(good, random) : mutate(good, random);
    if (near) ++mistyped;
    SCOPED_TRACE(text);
    ASSERT_NO_FATAL_FAILURE(loadInEveryWay(text, own));
    ASSERT_FALSE(HasFailure());
  }
  for (const Way way : {kAsList, kAsGains, kAsConfiguration}) {
    EXPECT_EQ(taken_[way] + refused_[way], files);
    EXPECT_GT(own_taken_[way], files / kWays / 20) << way;
    EXPECT_GT(own_refused_[way], files / kWays / 4) << way;
  }
  EXPECT_EQ(looks_, kWays * files);
  std::printf(
      "files written %ld, near-valid %ld, each loaded in %d ways, looks at what runs %ld, "
      "taken as list %ld, gains %ld, configuration %ld\n",
      files, mistyped, static_cast<int>(kWays), looks_, taken_[kAsList], taken_[kAsGains],
      taken_[kAsConfiguration]);
}

}  // namespace
}  // namespace ctrl_more
