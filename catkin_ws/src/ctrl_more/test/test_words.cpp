// Which known name is suggested for a wrong one, and what is said of it.
#include "ctrl_more/log/words.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

using Names = std::vector<std::string>;

TEST(Words, TwoLettersMayBeWrongAndAThirdOfALongName) {
  struct Case {
    std::string wrong, known;
    bool near;
  };
  const std::vector<Case> cases = {
      {"pelvis", "pelvis", true},         // the same
      {"plevis", "pelvis", true},         // two letters swapped
      {"xelvis", "pelvis", true},         // the first
      {"pelvix", "pelvis", true},         // the last
      {"pelv", "pelvis", true},           // two missing at the end
      {"lvis", "pelvis", true},           // two missing at the beginning
      {"xpelvisx", "pelvis", true},       // one too many at each end
      {"pexvxs", "pelvis", true},         // two different
      {"pxxvxs", "pelvis", false},        // three different of six
      {"zzzpel", "pelvis", false},        //
      {"qrs", "pel", false},              // three of three
      {"prs", "pel", true},               // two of three
      {"abcdefghi", "abcdefxyz", true},   // three of nine
      {"abcdefghi", "abcdewxyz", false},  // four of nine
      {"abcdefghijkl", "abcdefghwxyz", true},
      {"abcdefghijkl", "abcdefgvwxyz", false},
      {"ac", "abcd", true},  // two missing
      {"a", "abcd", false},
      {"PELVIS", "pelvis", true},  // the case does not matter
  };
  for (const Case& each : cases) {
    EXPECT_EQ(nearestName(each.wrong, {each.known}), each.near ? each.known : "")
        << each.wrong << " " << each.known;
  }
}

TEST(Words, OneNameInTheOtherIsNearIfBothHaveThreeLetters) {
  EXPECT_EQ(nearestName("abc", {"xxxxxxxxabcxxxxxxxx"}), "xxxxxxxxabcxxxxxxxx");
  EXPECT_EQ(nearestName("ab", {"xxxxxxxxabxxxxxxxx"}), "");
  EXPECT_EQ(nearestName("xxxxxxxxabcxxxxxxxx", {"abc"}), "abc");
  EXPECT_EQ(nearestName("xxxxxxxxabxxxxxxxx", {"ab"}), "");
  EXPECT_EQ(nearestName("abc", {"xxxxxxxxadcxxxxxxxx"}), "");
  EXPECT_EQ(nearestName("attitude", {"attitudes", "AttitudeMPCController"}), "attitudes")
      << "the nearer one, though the other holds it";
}

TEST(Words, TheNearestIsTakenAndTheFirstOfEqualOnes) {
  EXPECT_EQ(nearestName("kp", {"ki", "kd", "kq"}), "ki");
  EXPECT_EQ(nearestName("kpx", {"kixx", "kp"}), "kp");
  EXPECT_EQ(nearestName("", {"a", "b"}), "");
  const std::string longest(100, 'a');
  EXPECT_EQ(nearestName(longest, {longest}), longest);
  EXPECT_EQ(nearestName(longest + "a", {longest + "a"}), "") << "no suggestions for 101 letters";
}

TEST(Words, TwentyKnownNamesAreListed) {
  Names known;
  std::string listed;
  for (int i = 0; i < 20; ++i) {
    known.push_back("n" + std::to_string(100 + i));
    listed += (i == 0 ? " " : ", ") + known.back();
  }
  EXPECT_EQ(suggestion("something else", known), "; known:" + listed);
  known.push_back("n120");
  EXPECT_EQ(suggestion("something else", known), "; known:" + listed + ", ...");
  EXPECT_EQ(suggestion("something else", {"one"}), "; known: one");
  EXPECT_EQ(suggestion("n100x", known), "; did you mean 'n100'?");
  EXPECT_EQ(joined({}), "");
  EXPECT_EQ(joined({"a"}), "a");
  EXPECT_EQ(joined({"a", "b", "c"}), "a, b, c");
}

}  // namespace
}  // namespace ctrl_more
