// Whatever a list file or a gain file contains, it is taken or refused with a sentence, and the
// controller that runs keeps running.
#include <fstream>
#include <random>

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

TEST(ConfigFuzz, ListAndGainFilesNeverBreakWhatRuns) {
  const long runs = 100000;
  Rig rig(0.0, false, false);
  rig.logger.setLevel(LogLevel::Error);
  auto c = adder("pose", "ee", 1.0);
  c->description.gain("kp", 0).vector(3, 1.0).range(0, 2).in("1").about("x");
  c->description.gain("max_angle", 1.0).range(0, 2).in("rad").about("x");
  c->description.setting("mode", "fast").oneOf({"fast", "slow"}).about("x");
  rig.add(std::move(c), "running");
  const std::string list =
      "loadControllers: [Good, running]\nGood:\n  libPath: libgood.so\n  configFile: good.yaml\n"
      "  enabled: true\n  overrun_us: 100\nprofiles:\n  dmp: [running]\nsearchPath: [a, b]\n";
  const std::string gains =
      "type: TestController\nkp: [0.1, 0.2, 0.3]\nmax_angle: 0.5\nmode: fast\n";
  const std::string file = ::testing::TempDir() + "/ctrl_more_fuzz.yaml";
  std::mt19937 random(20180521);
  long taken = 0, refused = 0;
  for (long i = 0; i < runs; ++i) {
    const bool is_list = i % 2 == 0;
    const std::string text = mutate(is_list ? list : gains, random);
    try {
      const ConfigNode node = ConfigNode::fromText(text, "fuzz.yaml");
      if (is_list) {
        const LoadReport report = rig.manager->load(node, "/nowhere");
        for (const std::string& error : report.errors) ASSERT_FALSE(error.empty());
        (report.ok() ? taken : refused) += 1;
      } else {
        if (i % 20 == 1) std::ofstream(file, std::ios::binary) << text;
        const Status status = rig.manager->loadGains("running", file);
        ASSERT_TRUE(status.ok() || !status.message().empty());
        (status ? taken : refused) += 1;
      }
    } catch (const ConfigError& e) {
      ASSERT_TRUE(contains(e.what(), "fuzz.yaml:")) << e.what();
      ++refused;
    }
    if (i % 50 == 0) {
      rig.step();
      ASSERT_EQ(rig.pose()[0], 1.0);
      ASSERT_EQ(rig.manager->getControllersNames().size(), 1u);
    }
  }
  EXPECT_EQ(taken + refused, runs);
  EXPECT_GT(refused, runs / 10);
}

}  // namespace
}  // namespace ctrl_more
