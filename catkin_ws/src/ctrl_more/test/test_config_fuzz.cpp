// Whatever a list file or a gain file contains, it is taken or refused with a sentence, and the
// controller that runs keeps running.
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

/// One word or number of a file replaced by another that could stand there: what a person mistypes.
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

/// Loads a file; empty if it was taken, else the sentence.
std::string load(Rig& rig, Way way, const std::string& file) {
  if (way == kAsList) {
    const LoadReport report = rig.manager->load(file);
    for (const std::string& error : report.errors) EXPECT_FALSE(error.empty());
    return report.ok() ? "" : report.errors.front();
  }
  Status status;
  if (way == kAsGains) {
    status = rig.manager->loadGains("running", file);
  } else {
    ControllerEntry entry;
    entry.config_file = file;
    status = rig.manager->addController(configurable(), "configured", entry);
  }
  EXPECT_TRUE(status.ok() || !status.message().empty());
  return status ? "" : status.message();
}

/// What was taken goes again, so that the next file finds everything as this one did.
void unloadTheRest(Rig& rig) {
  for (const std::string& name : rig.manager->getControllersNames()) {
    if (name == "running") continue;
    ASSERT_TRUE(rig.manager->setProfile("dmp", {"running"}));
    rig.manager->disable(name, true);
    Status gone = Status::failure("not tried");
    for (int cycle = 0; cycle < 1000 && !gone; ++cycle) {  // until its correction has faded
      rig.step();
      gone = rig.manager->unload(name);
    }
    ASSERT_TRUE(gone) << gone.message();
  }
}

/// Every file is written and loaded, as list, as gains of a controller that runs, and as the
/// configuration of a new one; half of them differ from a good one by one word.
TEST(ConfigFuzz, ListAndGainAndConfigurationFilesNeverBreakWhatRuns) {
  constexpr long kRuns = 102000;
  Rig rig(0.0, false, false);
  rig.logger.setLevel(LogLevel::Error);
  rig.add(configurable(), "running");
  // In memory where that can be written: a hundred thousand files are hard on a disk.
  std::string folder = access("/dev/shm", W_OK) == 0 ? "/dev/shm" : ::testing::TempDir();
  folder += "/ctrl_more_fuzz_XXXXXX";
  ASSERT_NE(mkdtemp(&folder[0]), nullptr) << folder;
  const std::string file = folder + "/fuzz.yaml";
  std::ofstream(folder + "/good.yaml") << "type: Good\n";
  long taken[kWays] = {}, refused[kWays] = {};
  std::mt19937 random(20180521);
  for (long i = 0; i < kRuns; ++i) {
    const Way way = static_cast<Way>(i % kWays);
    const std::string& good = way == kAsList ? kList : kGains;
    const std::string text = (i / kWays) % 2 == 0 ? mutate(good, random) : mistype(good, random);
    SCOPED_TRACE(text);
    {
      std::ofstream out(file, std::ios::binary);
      out << text;
      ASSERT_TRUE(out.flush().good());
    }
    ++(load(rig, way, file).empty() ? taken : refused)[way];
    ASSERT_NO_FATAL_FAILURE(unloadTheRest(rig));
    if (i % 50 != 0) continue;
    rig.step();
    ASSERT_EQ(rig.pose()[0], 1.0);
    ASSERT_EQ(rig.manager->getControllersNames().size(), 1u);
  }
  for (const Way way : {kAsList, kAsGains, kAsConfiguration}) {
    EXPECT_EQ(taken[way] + refused[way], kRuns / kWays);
    EXPECT_GT(taken[way], kRuns / kWays / 20) << way;
    EXPECT_GT(refused[way], kRuns / kWays / 4) << way;
  }
  std::printf(
      "files written and loaded %ld, of these taken as list %ld, gains %ld, configuration %ld\n",
      kRuns, taken[kAsList], taken[kAsGains], taken[kAsConfiguration]);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace ctrl_more
