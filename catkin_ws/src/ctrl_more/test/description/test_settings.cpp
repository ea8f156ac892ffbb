// Settings and gains against their declaration: names, counts, ranges with their ends, and values
// that stay unchanged.
#include <fstream>

#include "ctrl_more/description/configuration.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

Description declared() {
  Description d;
  d.type = "X";
  d.setting("mode", "fast").oneOf({"fast", "slow"}).about("one of two");
  d.setting("key", "imu").about("any name");
  d.setting("mount", std::vector<double>{0, 0, 1}).range(-1.0, 2.0).in("1").about("three");
  d.setting("ends", std::vector<double>{1.0}).range(0.0, 9.0).in("rad").anySize().about("any");
  d.gain("kp", 0).vector(2, 1.0).range(-1.0, 2.0).in("1").about("two");
  d.gain("ki", 0.5).range(0.0, 1.0).in("1/s").about("one");
  return d;
}

TEST(Settings, TextsAreOneOfTheirChoicesAndNeverEmpty) {
  SettingValues values(declared().settings);
  EXPECT_EQ(values.text("mode"), "fast");
  EXPECT_TRUE(values.set("mode", std::string("slow")));
  EXPECT_EQ(values.text("mode"), "slow");
  const Status wrong = values.set("mode", std::string("slw"));
  for (const char* const name : {"'mode'", "'slw'", "'slow'"}) {
    EXPECT_TRUE(contains(wrong.message(), name)) << wrong.message();
  }
  EXPECT_TRUE(values.set("key", std::string("wrist_imu"))) << "no choices: any";
  EXPECT_FALSE(values.set("key", std::string()));
  EXPECT_EQ(values.text("key"), "wrist_imu");
  EXPECT_EQ(values.text("mode"), "slow");
}

TEST(Settings, NumbersHaveTheirCountAndRange) {
  SettingValues values(declared().settings);
  using Numbers = std::vector<double>;
  for (const Numbers& good : {Numbers{-1, 0, 2}, Numbers{0, 0, 1}}) {
    EXPECT_TRUE(values.set("mount", good)) << "the ends belong to the range";
    EXPECT_EQ(values.numbers("mount"), good);
  }
  for (const Numbers& bad : {Numbers{}, Numbers{1}, Numbers{0, 0, 0, 0}, Numbers{0, 0, 2.001},
                             Numbers{-1.001, 0, 0}, Numbers{0, std::nan(""), 0}}) {
    EXPECT_FALSE(values.set("mount", bad)) << bad.size();
    EXPECT_EQ(values.numbers("mount"), (Numbers{0, 0, 1}));
  }
  EXPECT_TRUE(contains(values.set("mount", Numbers{0, 0, 3}).message(), "-1 to 2 1, got 3"));
  EXPECT_TRUE(contains(values.set("mount", Numbers{1}).message(), "'mount' expects 3"));
  EXPECT_TRUE(values.set("ends", Numbers{1, 2, 3})) << "any count";
  EXPECT_EQ(values.numbers("ends").size(), 3u);
  EXPECT_FALSE(values.set("ends", Numbers{}));
}

TEST(ControllerFiles, SetTheNamedValues) {
  const ControllerConfig config = readControllerConfig(
      declared(), ConfigNode::fromText("type: X\nkp: [0, 2]\nmode: slow\nends: [1, 2]\n", "f"));
  EXPECT_EQ(config.settings.text("mode"), "slow");
  EXPECT_EQ(config.settings.text("key"), "imu");
  EXPECT_EQ(config.settings.numbers("ends"), (std::vector<double>{1, 2}));
  EXPECT_EQ(config.gains.all().at("kp"), (std::vector<double>{0, 2}));
  EXPECT_EQ(config.gains.all().at("ki"), std::vector<double>{0.5});
  const auto refusal = [](const std::string& text) -> std::string {
    try {
      readControllerConfig(declared(), ConfigNode::fromText(text, "f"));
    } catch (const ConfigError& e) {
      return e.what();
    }
    return "";
  };
  for (const char* const name : {"f:2: ", "type 'Y'", "type 'X'"}) {
    EXPECT_TRUE(contains(refusal("\ntype: Y\n"), name)) << refusal("\ntype: Y\n");
  }
  EXPECT_TRUE(contains(refusal("mode: [1]\n"), "f:1: setting 'mode'"));
  EXPECT_TRUE(contains(refusal("kp: {a: 1}\n"), "f:1: gain 'kp' expects numbers"));
  EXPECT_TRUE(contains(refusal("kpp: 1\n"), "did you mean 'kp'"));
}

}  // namespace
}  // namespace ctrl_more
