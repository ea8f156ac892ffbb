#include <fstream>

#include "ctrl_more/log/words.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

std::string messageOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "";
}

TEST(ConfigTest, ReadsScalarsListsAndMapsWithTheirLines) {
  const ConfigNode root = ConfigNode::fromText("a: 1.5\nb: [1, 2]\nc:\n  d: true\n", "f.yaml");
  EXPECT_EQ(root.find("a")->number("a"), 1.5);
  EXPECT_EQ(root.find("b")->numbers("b"), (std::vector<double>{1, 2}));
  EXPECT_TRUE(root.find("c")->find("d")->boolean("d"));
  EXPECT_EQ(root.find("c")->find("d")->place(), "f.yaml:4");
  EXPECT_EQ(root.find("e"), nullptr);
  EXPECT_EQ(root.keys(), (std::vector<std::string>{"a", "b", "c"}));
}

TEST(ConfigTest, ErrorsNameFileLineAndField) {
  const ConfigNode root = ConfigNode::fromText("a: x\nb: {c: 1}\nn: .nan\nh: 1e999\n", "f.yaml");
  EXPECT_EQ(messageOf([&] { root.find("a")->number("gain 'a'"); }),
            "f.yaml:1: gain 'a' expects a number, got 'x'");
  EXPECT_FALSE(messageOf([&] { root.find("b")->number("b"); }).empty());
  EXPECT_FALSE(messageOf([&] { root.find("b")->text("b"); }).empty());
  EXPECT_FALSE(messageOf([&] { root.find("b")->texts("b"); }).empty());
  EXPECT_FALSE(messageOf([&] { root.find("n")->number("n"); }).empty());
  EXPECT_FALSE(messageOf([&] { root.find("h")->number("h"); }).empty());
  EXPECT_FALSE(messageOf([&] { root.find("a")->boolean("a"); }).empty());
  EXPECT_EQ(messageOf([&] {
              root.requireKeys("it", {"aa", "b", "n", "h"});
            }),
            "f.yaml:1: it has an unknown key 'a'; did you mean 'aa'?");
}

TEST(ConfigTest, HostileFilesAreRefused) {
  std::string deep;
  for (int i = 0; i < 100; ++i) deep += "[";
  EXPECT_FALSE(messageOf([&] { ConfigNode::fromText(deep, "f"); }).empty());
  std::string closed = deep;
  for (int i = 0; i < 100; ++i) closed += "]";
  EXPECT_TRUE(contains(messageOf([&] { ConfigNode::fromText(closed, "f"); }), "nested"));
  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 10; ++i) {
    const std::string last = "*a" + std::to_string(i - 1);
    bomb += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [";
    for (int k = 0; k < 10; ++k) bomb += (k ? ", " : "") + last;
    bomb += "]\n";
  }
  EXPECT_TRUE(contains(messageOf([&] { ConfigNode::fromText(bomb, "f"); }), "20000 nodes"));
  EXPECT_TRUE(contains(messageOf([&] { ConfigNode::fromText("a: &a [*a]\n", "f"); }), "f:"));
  EXPECT_TRUE(contains(messageOf([&] { ConfigNode::fromText("a: 1\na: 2\n", "f"); }), "twice"));
  EXPECT_TRUE(contains(messageOf([&] { ConfigNode::fromText("? [1]\n: 2\n", "f"); }), "key"));
  EXPECT_TRUE(
      contains(messageOf([&] { ConfigNode::fromText(std::string(2000000, ' '), "f"); }), "1 MB"));
  EXPECT_TRUE(contains(messageOf([] { ConfigNode::fromFile("/nowhere.yaml"); }), "/nowhere.yaml"));
  EXPECT_TRUE(contains(messageOf([&] { ConfigNode::fromText("a: [1\nb: 2", "f"); }), "f:"));
}

TEST(ConfigTest, NearestNames) {
  const std::vector<std::string> known = {"Compliant", "ZmpIP", "AttitudeMPCController"};
  EXPECT_EQ(nearestName("Attitude", known), "AttitudeMPCController");
  EXPECT_EQ(nearestName("zmpip", known), "ZmpIP");
  EXPECT_EQ(nearestName("Compliantt", known), "Compliant");
  EXPECT_EQ(nearestName("Xyz", known), "");
  EXPECT_EQ(suggestion("Xyz", known), "; known: Compliant, ZmpIP, AttitudeMPCController");
  EXPECT_EQ(suggestion("Xyz", {}), "; there is none");
}

TEST(ConfigTest, GainsAreCheckedOneByOne) {
  Description d;
  d.gain("kp", 0).vector(3, 1.0).range(0, 2).in("1").about("x");
  GainValues gains(d.gains);
  EXPECT_TRUE(gains.set("kp", {0.5}));
  EXPECT_EQ(gains.all().at("kp"), (std::vector<double>{0.5, 0.5, 0.5}));
  EXPECT_TRUE(gains.set("kp", {0, 1, 2}));
  EXPECT_FALSE(gains.set("kp", {0, 1}));
  EXPECT_FALSE(gains.set("kp", {}));
  EXPECT_FALSE(gains.set("kp", {0, 1, 2.1}));
  EXPECT_FALSE(gains.set("kp", {std::nan("")}));
  EXPECT_EQ(gains.all().at("kp"), (std::vector<double>{0, 1, 2}));
  EXPECT_THROW(gains.find("kq"), std::invalid_argument);
}

TEST(ConfigTest, GainsOfAnotherControllerAreLeftWhereTheyAre) {
  Description three, two;
  three.gain("kp", 0).vector(3, 1.0).range(0, 2).in("1").about("x");
  two.gain("kp", 0).vector(2, 0.5).range(0, 2).in("1").about("x");
  GainValues gains(three.gains);
  const GainValues before = gains, others(two.gains);
  gains.assign(others);
  EXPECT_TRUE(gains.sameAs(before));
  gains.blend(others, before, 0.5);
  EXPECT_TRUE(gains.sameAs(before));
  gains.blend(before, others, 0.5);
  EXPECT_TRUE(gains.sameAs(before));
}

// Lists in lists, or maps in maps.
std::string nested(int levels, bool maps) {
  std::string text;
  for (int i = 0; i < levels; ++i) text += maps ? "{a: " : "[";
  if (maps) text += "1";
  for (int i = 0; i < levels; ++i) text += maps ? "}" : "]";
  return text;
}

std::string manyItems(int count) {
  std::string text = "[1";
  for (int i = 1; i < count; ++i) text += ",1";
  return text + "]";
}

TEST(ConfigTest, BoundsOfAFileAreWhereTheyAreSaidToBe) {
  const auto said = [](const std::string& text) {
    return messageOf([&] { ConfigNode::fromText(text, "f"); });
  };
  EXPECT_EQ(said(nested(33, false)), "") << "the innermost list is at depth 32";
  EXPECT_EQ(said(nested(34, false)), "f:1: nested deeper than 32 levels");
  EXPECT_EQ(said(nested(32, true)), "") << "the innermost number is at depth 32";
  EXPECT_EQ(said(nested(33, true)), "f:1: nested deeper than 32 levels");
  EXPECT_EQ(said(manyItems(19999)), "") << "and the list itself";
  EXPECT_EQ(said(manyItems(20000)), "f:1: more than 20000 nodes (aliases counted)");
  EXPECT_EQ(said("a: 1\n#" + std::string((1 << 20) - 6, 'x')), "");
  EXPECT_EQ(said("a: 1\n#" + std::string((1 << 20) - 5, 'x')),
            "f:1: larger than 1 MB; this is no configuration file");
  const std::string file = ::testing::TempDir() + "/ctrl_more_large.yaml";
  for (const int more : {0, 1}) {
    std::ofstream(file) << "a: 1\n#" + std::string((1 << 20) - 6 + more, 'x');
    EXPECT_EQ(contains(messageOf([&] { ConfigNode::fromFile(file); }), "1 MB"), more == 1);
  }
}

TEST(ConfigTest, NumbersAndTruthsAreReadWholeOrNotAtAll) {
  const auto number = [](const std::string& text) {
    return messageOf([&] { ConfigNode::fromText("a: " + text, "f").find("a")->number("n"); });
  };
  for (const char* good : {"1", "-1.5", "1e-3", "+2", "0"}) EXPECT_EQ(number(good), "") << good;
  for (const char* bad : {"1x", "1 2", "''", "x1", "0x1g", "[1]", ".inf", "1,5"}) {
    EXPECT_NE(number(bad), "") << bad;
  }
  EXPECT_TRUE(contains(number("{b: 1}"), "got 'something else'"));
  const auto truth = [](const std::string& text) {
    return ConfigNode::fromText("a: " + text, "f").find("a")->boolean("b");
  };
  EXPECT_TRUE(truth("true"));
  EXPECT_FALSE(truth("false"));
  for (const char* bad : {"True", "yes", "1", "[true]"}) EXPECT_THROW(truth(bad), ConfigError);
  const ConfigNode map = ConfigNode::fromText("a: {b: 1}\nc: 2\n", "f");
  EXPECT_EQ(messageOf([&] { map.find("a")->numbers("n"); }), "f:1: n expects numbers");
  EXPECT_EQ(messageOf([&] { map.find("c")->texts("t"); }), "f:2: t expects a list of names");
  EXPECT_EQ(map.find("c")->numbers("n"), std::vector<double>{2.0}) << "one number is a list of one";
  EXPECT_EQ(map.find("c")->line(), 2);
}

}  // namespace
}  // namespace ctrl_more
