// Library files: round trip, learning on load, all or nothing, refusal of malformed files.
#include <gtest/gtest.h>

#include <sys/stat.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "coglab_controllers/dmp/dmp.hpp"
#include "coglab_controllers/dmp/library.hpp"
#include "core_support.hpp"

using namespace coglab_controllers;
using namespace coglab_controllers::test;

namespace {

const char* const kMinimal = R"(<?xml version="1.0"?>
<dmp_library version="1">
  <primitive id="p">
    <system duration="1.2" alpha="4.6" stiffness="150" damping="24.5"/>
    <goal_weight kind="linear"/>
    <shape mapping="none"/>
    <start position="0 0 0" velocity="0 0 0"/>
    <goal position="0.5 0 0"/>
    <basis centre="1" width="10" weight="0.1 0 0"/>
    <basis centre="0.1" width="10" weight="0.2 0 0"/>
  </primitive>
</dmp_library>
)";

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const auto at = text.find(what);
  if (at == std::string::npos) throw std::runtime_error("no '" + what + "' in the text");
  return text.replace(at, what.size(), by);
}

std::string errorOf(const std::string& text) {
  Library library;
  library.add([] {
    Random random(1);
    Primitive p = randomPrimitive(random);
    p.id = "kept";
    return p;
  }());
  try {
    library.parse(text, "file.xml");
  } catch (const LibraryError& error) {
    EXPECT_EQ(library.primitives().size(), 1u) << "nothing may be loaded from a bad file";
    return error.what();
  }
  return "";
}

std::string sampleText(int count) {
  std::string text =
      "<dmp_library version=\"1\"><primitive id=\"t\"><learn basis=\"10\"/><trajectory>";
  for (int i = 0; i < count; ++i) {
    const double u = static_cast<double>(i) / (count - 1);
    text += "<sample t=\"" + std::to_string(1.2 * u) + "\" position=\"" +
            std::to_string(0.5 * minimumJerk(u)) + " 0 0\"/>";
  }
  return text + "</trajectory></primitive></dmp_library>";
}

}  // namespace

TEST(Library, ReadsBackTheSameBits) {
  Random random(5);
  Library written;
  for (int i = 0; i < 100; ++i) {
    Primitive p = randomPrimitive(random);
    p.id = "p" + std::to_string(i);
    p.description = "a <b> & \"c\" 'd' \xc3\xa4";
    p.mapping = static_cast<ShapeMapping>(i % 3);
    if (i % 2)
      p.goal_weight = {GoalWeight::Kind::Sigmoid, random.uniform(0, 1), random.uniform(1, 100)};
    written.add(p);
  }
  Library read;
  EXPECT_EQ(read.parse(written.format(), "text"), 100);
  EXPECT_EQ(read.format(), written.format());
  for (const auto& [id, p] : written.primitives()) {
    const Primitive& q = read.at(id);
    EXPECT_EQ(p.weights, q.weights);
    EXPECT_EQ(p.centres, q.centres);
    EXPECT_EQ(p.duration, q.duration);
    EXPECT_EQ(p.description, q.description);
    EXPECT_EQ(p.mapping, q.mapping);
    EXPECT_EQ(p.goal_weight.kind, q.goal_weight.kind);
  }
}

TEST(Library, SavesAndLoadsFiles) {
  const std::string path = ::testing::TempDir() + "/coglab_library.xml";
  Library library;
  EXPECT_EQ(library.parse(kMinimal, "minimal"), 1);
  library.save(path);
  Library again;
  EXPECT_EQ(again.load(path), 1);
  EXPECT_EQ(again.format(), library.format());
  std::remove(path.c_str());
  EXPECT_THROW(again.load(path), LibraryError);
  EXPECT_THROW(again.load(::testing::TempDir()), LibraryError);
  EXPECT_THROW(again.save("/nonexistent/folder/file.xml"), LibraryError);
  EXPECT_EQ(again.primitives().size(), 1u);
}

TEST(Library, ThePackagesPrimitivesLoad) {
  Library library;
  EXPECT_EQ(library.load(std::string(COGLAB_PACKAGE_DIR) + "/config/primitives.xml"), 5);
  for (const char* id : {"reach_human", "give_human", "take_board", "put_board"})
    EXPECT_NE(library.find(id), nullptr);
  EXPECT_NEAR(library.at("reach_human").duration, 1.2, 1e-12);
}

TEST(Library, LearnsTrajectoriesWhenRead) {
  Library library;
  EXPECT_EQ(library.parse(sampleText(121), "text"), 1);
  const Primitive& p = library.at("t");
  EXPECT_EQ(p.basisCount(), 10);
  EXPECT_NEAR(p.goal.x(), 0.5, 1e-9);
  const Eigen::Matrix3Xd path = reproduce(p, {0.0, 0.6, 1.2});
  EXPECT_NEAR(path(0, 1), 0.25, 0.002);
}

/// golden/make_golden.py computes the golden files independently, from the equations in numpy.
TEST(Library, GoldenFilesMeanTheSameAsInPython) {
  const std::string folder = std::string(COGLAB_PACKAGE_DIR) + "/test/golden/";
  Library weights, learnt;
  EXPECT_EQ(weights.load(folder + "weights.xml"), 3);
  EXPECT_EQ(weights.format(), readFile(folder + "weights.xml"));
  EXPECT_EQ(learnt.load(folder + "demonstrations.xml"), 3);
  for (const auto& [id, p] : weights.primitives()) {
    EXPECT_LT((learnt.at(id).weights - p.weights).norm(), 1e-6) << id;
  }
  std::istringstream rows(readFile(folder + "motions.csv"));
  std::string line, running;
  std::getline(rows, line);
  Dmp dmp;
  int step = 0, compared = 0;
  while (std::getline(rows, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    std::string id;
    int until = 0;
    Vector3 expected;
    fields >> id >> until >> expected[0] >> expected[1] >> expected[2];
    const Primitive& p = weights.at(id);
    const Vector3 goal = p.goal + Vector3(0.05, -0.1, 0.02);
    if (id != running) {
      dmp = Dmp(p);
      dmp.start(p.start, Vector3::Zero(), goal, 1.3);
      running = id;
      step = 0;
    }
    for (; step < until; ++step) dmp.step(0.005, goal);
    EXPECT_LT((dmp.state().position - expected).norm(), 2e-8) << line;
    ++compared;
  }
  EXPECT_EQ(compared, 60);
}

TEST(Library, AnUnknownIdNamesThoseLoaded) {
  Library library;
  library.parse(kMinimal, "minimal");
  try {
    library.at("other");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("loaded are: p"), std::string::npos) << error.what();
  }
}

TEST(Library, RefusesWithFileAndLine) {
  const std::string good = kMinimal;
  const struct {
    const char *what, *by, *expected;
  } cases[] = {
      {"version=\"1\">\n", "version=\"2\">\n", "file.xml:2: <dmp_library>: version"},
      {"<dmp_library version=\"1\">", "<dmp_library>", "file.xml:2:"},
      {"duration=\"1.2\"", "duration=\"nan\"", "file.xml:4: <system>: duration: expected"},
      {"duration=\"1.2\"", "duration=\"inf\"", "finite"},
      {"duration=\"1.2\"", "duration=\"1.2x\"", "finite"},
      {"duration=\"1.2\"", "duration=\"\"", "finite"},
      {"duration=\"1.2\"", "duration=\"0\"", "duration: expected"},
      {"duration=\"1.2\"", "duration=\"-1\"", "duration: expected"},
      {"duration=\"1.2\"", "", "'duration' is missing"},
      {"duration=\"1.2\"", "duration=\"1\" duration=\"2\"", "file.xml:4:"},
      {"duration=\"1.2\"", "duration=\"1\" colour=\"2\"", "unknown attribute 'colour'"},
      {"kind=\"linear\"", "kind=\"cubic\"", "sigmoid, got 'cubic'"},
      {"kind=\"linear\"", "kind=\"sigmoid\" centre=\"7\" steepness=\"3\"", "goal_weight.centre"},
      {"mapping=\"none\"", "mapping=\"mirror\"", "upright, got 'mirror'"},
      {"position=\"0.5 0 0\"", "position=\"0.5 0\"", "three finite numbers"},
      {"position=\"0.5 0 0\"", "position=\"0.5 0 0 0\"", "three finite numbers"},
      {"position=\"0.5 0 0\"", "position=\"0.5 NaN 0\"", "three finite numbers"},
      {"position=\"0.5 0 0\"", "position=\"1e300 0 0\"", "goal.position"},
      {"weight=\"0.1 0 0\"", "weight=\"1e9 0 0\"", "basis[0].weight"},
      {"<basis centre=\"1\"", "<basis centre=\"4\"", "basis[0].centre"},
      {"<goal position=\"0.5 0 0\"/>", "", "<goal> is missing"},
      {"<goal position=\"0.5 0 0\"/>", "<goal position=\"0 0 0\"/><goal position=\"0 0 0\"/>",
       "twice"},
      {"<goal position=\"0.5 0 0\"/>", "<goal position=\"0 0 0\"/>words", "'words"},
      {"<goal position=\"0.5 0 0\"/>", "<goal position=\"0 0 0\"/><extra/>", "unexpected <extra>"},
      {"id=\"p\"", "id=\"p q\"", "id: expected"},
      {"id=\"p\"", "", "id"},
      {"<primitive id=\"p\">", "<movement/><primitive id=\"p\">",
       "expected <primitive>, got <movement>"},
      {"</dmp_library>", "", "file.xml:"},
      {"</dmp_library>", "</dmp_library><dmp_library version=\"1\"/>", "one root element"},
      {"<dmp_library", "<!DOCTYPE x [<!ENTITY a \"aaaa\">]><dmp_library", "entities are refused"},
      {"<dmp_library", "<library", "file.xml:"},
  };
  EXPECT_EQ(errorOf(good), "");
  for (const auto& c : cases) {
    const std::string error = errorOf(replaced(good, c.what, c.by));
    EXPECT_NE(error.find(c.expected), std::string::npos)
        << c.what << " -> " << c.by << "\ngot: " << error;
    EXPECT_EQ(error.find("file.xml:"), 0u) << error;
  }
}

TEST(Library, RefusesDuplicatesWithinAFileAndReplacesAcrossFiles) {
  const std::string good = kMinimal;
  const auto begin = good.find("  <primitive"), end = good.find("</dmp_library>");
  const std::string doubled = good.substr(0, end) + good.substr(begin);
  EXPECT_NE(errorOf(doubled).find("'p'"), std::string::npos);
  EXPECT_NE(errorOf(doubled).find("twice"), std::string::npos);
  Library library;
  EXPECT_EQ(library.parse(good, "one"), 1);
  EXPECT_EQ(library.parse(replaced(good, "duration=\"1.2\"", "duration=\"2.4\""), "two"), 1);
  EXPECT_EQ(library.at("p").duration, 2.4);
}

TEST(Library, RefusesBombsAndOversize) {
  // Entities that would grow a billion times if anyone expanded them.
  std::string bomb = "<!DOCTYPE lolz [<!ENTITY a \"ha\">";
  for (char c = 'b'; c <= 'j'; ++c) {
    bomb += std::string("<!ENTITY ") + c + " \"";
    for (int i = 0; i < 10; ++i) bomb += std::string("&") + static_cast<char>(c - 1) + ";";
    bomb += "\">";
  }
  bomb += "]><dmp_library version=\"1\"><primitive id=\"&j;\"/></dmp_library>";
  EXPECT_NE(errorOf(bomb), "");
  std::string deep = "<dmp_library version=\"1\">";
  for (int i = 0; i < 200000; ++i) deep += "<a>";
  EXPECT_NE(errorOf(deep), "");
  EXPECT_NE(errorOf(std::string(Library::kMaxFileBytes + 1, ' ')).find("at most"),
            std::string::npos);
  EXPECT_NE(errorOf(sampleText(Library::kMaxSamples + 2)).find("at most 20000 samples"),
            std::string::npos);
  std::string many = "<dmp_library version=\"1\">";
  const std::string good = kMinimal;
  const auto begin = good.find("  <primitive"), end = good.find("</dmp_library>");
  for (int i = 0; i <= Library::kMaxPrimitives; ++i) {
    many +=
        replaced(good.substr(begin, end - begin), "id=\"p\"", "id=\"p" + std::to_string(i) + "\"");
  }
  EXPECT_NE(errorOf(many + "</dmp_library>").find("at most 500 primitives"), std::string::npos);
  EXPECT_NE(errorOf(std::string("<dmp_library\0 version=\"1\"/>", 27)).find("zero byte"),
            std::string::npos);
}

TEST(Library, SurvivesRandomDamage) {
  Random random(9);
  const std::string good = kMinimal;
  int refused = 0;
  const int rounds = std::getenv("COGLAB_LONG") ? 2000000 : 40000;
  for (int k = 0; k < rounds; ++k) {
    std::string text = good;
    for (int i = random.integer(1, 6); i > 0; --i) {
      const auto at =
          static_cast<std::size_t>(random.integer(0, static_cast<int>(text.size()) - 1));
      switch (random.integer(0, 3)) {
        case 0:
          text[at] = static_cast<char>(random.integer(0, 255));
          break;
        case 1:
          text.erase(at, static_cast<std::size_t>(random.integer(1, 20)));
          break;
        case 2:
          text.insert(at, text.substr(static_cast<std::size_t>(
                                          random.integer(0, static_cast<int>(text.size()) - 1)),
                                      15));
          break;
        default:
          text.insert(at, std::string(static_cast<std::size_t>(random.integer(1, 30)),
                                      "<>&\"'/!-0e"[random.integer(0, 9)]));
      }
      if (text.empty()) text = "<";
    }
    Library library;
    try {
      library.parse(text, "file.xml");
      for (const auto& [id, p] : library.primitives()) validate(p);
    } catch (const LibraryError& error) {
      ++refused;
      ASSERT_EQ(std::string(error.what()).find("file.xml:"), 0u);
      ASSERT_TRUE(library.primitives().empty());
    }
  }
  EXPECT_GT(refused, rounds / 2);
}
