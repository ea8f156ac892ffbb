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
  const std::string wrong = messageOf([&] { root.find("a")->number("gain 'a'"); });
  EXPECT_EQ(wrong.rfind("f.yaml:1: gain 'a'", 0), 0u) << wrong;
  EXPECT_TRUE(contains(wrong, "got 'x'")) << wrong;
  EXPECT_FALSE(messageOf([&] { root.find("b")->number("b"); }).empty());
  EXPECT_FALSE(messageOf([&] { root.find("b")->text("b"); }).empty());
  EXPECT_FALSE(messageOf([&] { root.find("b")->texts("b"); }).empty());
  EXPECT_FALSE(messageOf([&] { root.find("n")->number("n"); }).empty());
  EXPECT_FALSE(messageOf([&] { root.find("h")->number("h"); }).empty());
  EXPECT_FALSE(messageOf([&] { root.find("a")->boolean("a"); }).empty());
  const std::string unknown = messageOf([&] { root.requireKeys("it", {"aa", "b", "n", "h"}); });
  EXPECT_EQ(unknown.rfind("f.yaml:1: it ", 0), 0u) << unknown;
  EXPECT_TRUE(contains(unknown, "'a'")) << unknown;
  EXPECT_TRUE(contains(unknown, "'aa'")) << unknown;
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
  for (const std::string& name : known) EXPECT_TRUE(contains(suggestion("Xyz", known), name));
  EXPECT_TRUE(contains(suggestion("Xyz", {}), "none"));
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
  EXPECT_TRUE(contains(messageOf([&] { map.find("a")->numbers("n"); }), "f:1: n expects"));
  EXPECT_TRUE(contains(messageOf([&] { map.find("c")->texts("t"); }), "f:2: t expects"));
  EXPECT_EQ(map.find("c")->numbers("n"), std::vector<double>{2.0}) << "one number is a list of one";
  EXPECT_EQ(map.find("c")->line(), 2);
}

}  // namespace
}  // namespace ctrl_more
