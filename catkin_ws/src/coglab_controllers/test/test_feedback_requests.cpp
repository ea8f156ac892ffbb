// What a request to the feedback controllers may carry, as FeedbackSelect.srv says.
#include <cstdio>

#include <gtest/gtest.h>

#include "coglab_controllers/manager/feedback_requests.hpp"

namespace coglab_controllers {
namespace {

using ctrl_more::Cause;
using ctrl_more::ControllerStatus;
using ctrl_more::PauseCause;
using ctrl_more::Status;

ControllerStatus controller(const std::string& name, const std::vector<std::string>& reasons,
                            PauseCause cause = PauseCause::User) {
  ControllerStatus status;
  status.name = name;
  status.reasons = reasons;
  status.causes.assign(reasons.size(), cause);
  status.paused = !reasons.empty();
  return status;
}

TEST(FeedbackRequests, AnyPrintableTextIsAReason) {
  for (const std::string fine : {"", "user", "two words", "%s%n", "{[}:", "../../x", "-1", "nan",
                                 "caf\u00e9", "\u2603 \U0001f600", "\u05d0"}) {
    EXPECT_TRUE(judgeReason(fine).ok()) << fine << ": " << judgeReason(fine).message();
  }
  EXPECT_TRUE(judgeReason(std::string(kLongestReason, 'x')).ok());
}

TEST(FeedbackRequests, WhatCannotBeShownAsItIsIsRefusedWithoutBeingShown) {
  const std::vector<std::string> wrong = {
      std::string(1, '\0'),
      std::string("a\0b", 3),
      " ",
      "\u00a0\u3000",
      "a\nb",
      "\x1b[2J",
      "\x7f",
      "\u0085",
      "\u2028",
      "\u202ex",
      "\u2066x",
      "\x80",
      "\xc0\xaf",
      "\xe2\x98",
      "\xe0\x80\x80",
      "\xed\xa0\x80",
      "\xf4\x90\x80\x80",
      "\xf5\x80\x80\x80",
      "x\xff",
      std::string(kLongestReason + 1, 'x'),
  };
  for (const std::string& reason : wrong) {
    const Status status = judgeReason(reason);
    EXPECT_EQ(status.cause(), Cause::InvalidArgument) << reason;
    EXPECT_NE(status.message().find("expected printable text"), std::string::npos);
    for (const char c : status.message()) EXPECT_TRUE(c >= ' ' && c <= '~') << status.message();
  }
}

/// A character as UTF-8.
std::string utf8(std::uint32_t c) {
  const auto last = [](std::uint32_t bits) { return static_cast<char>(0x80 | (bits & 0x3f)); };
  if (c < 0x80) return {static_cast<char>(c)};
  if (c < 0x800) return {static_cast<char>(0xc0 | c >> 6), last(c)};
  if (c < 0x10000) return {static_cast<char>(0xe0 | c >> 12), last(c >> 6), last(c)};
  return {static_cast<char>(0xf0 | c >> 18), last(c >> 12), last(c >> 6), last(c)};
}

TEST(FeedbackRequests, EachCharacterIsShownIsBlankOrSteersTheDisplay) {
  for (const std::uint32_t shown :
       {0x21u,   0x7eu,   0xa1u,   0x61bu,  0x61du,  0x7ffu,  0x800u,  0x167fu,  0x1681u,
        0x1fffu, 0x200bu, 0x200du, 0x2010u, 0x2027u, 0x2030u, 0x205eu, 0x2060u,  0x2065u,
        0x206au, 0x2fffu, 0x3001u, 0xd7ffu, 0xe000u, 0xfffdu, 0xffffu, 0x10000u, 0x10ffffu}) {
    EXPECT_TRUE(judgeReason(utf8(shown)).ok()) << std::hex << shown;
  }
  for (const std::uint32_t blank :
       {0x20u, 0xa0u, 0x1680u, 0x2000u, 0x2005u, 0x200au, 0x202fu, 0x205fu, 0x3000u}) {
    const Status alone = judgeReason(utf8(blank));
    EXPECT_NE(alone.message().find("has only spaces"), std::string::npos) << std::hex << blank;
    EXPECT_TRUE(judgeReason("a" + utf8(blank)).ok()) << std::hex << blank;
    EXPECT_TRUE(judgeReason(utf8(blank) + "a").ok()) << std::hex << blank;
  }
  for (const std::uint32_t steers :
       {0x1u, 0x1fu, 0x7fu, 0x80u, 0x9fu, 0x61cu, 0x200eu, 0x200fu, 0x2028u, 0x2029u, 0x202au,
        0x202eu, 0x2066u, 0x2067u, 0x2069u}) {
    char number[40];
    std::snprintf(number, sizeof number, "U+%04X at byte 1", static_cast<unsigned>(steers));
    const Status status = judgeReason("a" + utf8(steers) + "b");
    EXPECT_NE(status.message().find(number), std::string::npos) << status.message();
  }
}

TEST(FeedbackRequests, BytesThatAreNoUtf8AreToldWithTheirPlace) {
  for (const char* wrong :
       {"\xc1\xbf", "\xc2", "\xc2x", "\xe0\x9f\xbf", "\xe1\x80", "\xe1\x80x", "\xe1x\x80",
        "\xed\xbf\xbf", "\xf0\x8f\xbf\xbf", "\xf1\x80\x80", "\xf1\x80\x80x", "\xf4\x90\x80\x80",
        "\xf5\x80\x80\x80", "\x80", "\xbf", "\xff"}) {
    const Status status = judgeReason(std::string("ab") + wrong);
    EXPECT_NE(status.message().find("is no UTF-8 at byte 2"), std::string::npos)
        << status.message();
  }
  EXPECT_NE(judgeReason(std::string(201, 'x'))
                .message()
                .find("has 201 bytes; expected printable "
                      "text of at most 200 bytes"),
            std::string::npos);
  EXPECT_EQ(kLongestReason, 200u);
}

TEST(FeedbackRequests, WhoIsPausedForWhatIsNamedWhereNothingCanBeWithdrawn) {
  const std::vector<ControllerStatus> loaded = {
      controller("a", {"lunch", "tea"}), controller("b", {}),
      controller("d", {"fault: it threw"}, PauseCause::Fault)};
  const std::string all = judgeResume(loaded, {}, "supper").message();
  for (const std::string word :
       {"'supper'", "a for ", "lunch", "tea", "; b for no reason", "; d for "}) {
    EXPECT_NE(all.find(word), std::string::npos) << all;
  }
  const std::string one = judgeResume(loaded, {"b"}, "lunch").message();
  EXPECT_NE(one.find(": b for no reason, it is not paused"), std::string::npos) << one;
  EXPECT_EQ(one.find("a for"), std::string::npos) << one;
  EXPECT_TRUE(judgeResume(loaded, {"a"}, "tea").ok());
  EXPECT_TRUE(judgeResume(loaded, {}, "fault").ok());
  EXPECT_TRUE(judgeResume({}, {}, "lunch").ok()) << "nobody is there to be paused";
}

TEST(FeedbackRequests, AreRefusedInWholeSentences) {
  const std::string rest = "; expected printable text of at most 200 bytes, or none for 'user'";
  EXPECT_EQ(judgeReason(std::string(201, 'x')).message(), "reason has 201 bytes" + rest);
  EXPECT_EQ(judgeReason("  ").message(), "reason has only spaces" + rest);
  EXPECT_EQ(judgeReason("ab\xff").message(), "reason is no UTF-8 at byte 2" + rest);
  EXPECT_EQ(judgeReason("\u00e9\n").message(),
            "reason has the unprintable character U+000A at byte 2" + rest);
  EXPECT_EQ(judgeNames({"a", "b", ""}).message(),
            "names[2] is empty; expected names of loaded controllers, or a list without any name "
            "for all of them");
  const std::vector<ControllerStatus> loaded = {controller("a", {"lunch"}), controller("b", {})};
  EXPECT_EQ(judgeResume(loaded, {"a", "b"}, "lunch").message(),
            "reason 'lunch' is none that can be withdrawn; expected one of those in "
            "feedback/status, where is paused: b for no reason, it is not paused");
}

TEST(FeedbackRequests, AnEmptyNameIsNotAllOfThem) {
  EXPECT_TRUE(judgeNames({}).ok());
  EXPECT_TRUE(judgeNames({"a", "a", "b"}).ok()) << "a name given twice counts once";
  EXPECT_EQ(judgeNames({""}).cause(), Cause::InvalidArgument);
  EXPECT_NE(judgeNames({"a", ""}).message().find("names[1]"), std::string::npos);
}

TEST(FeedbackRequests, OnlyAReasonThatIsThereIsWithdrawn) {
  const std::vector<ControllerStatus> loaded = {
      controller("a", {"lunch"}), controller("b", {}), controller("c", {"lunch", "user"}),
      controller("d", {"fault: it threw"}, PauseCause::Fault)};
  for (const std::vector<std::string>& names :
       {std::vector<std::string>{"a"}, {"a", "c", "a"}, {}, {"nobody"}}) {
    EXPECT_TRUE(judgeResume(loaded, names, "lunch").ok());
  }
  EXPECT_TRUE(judgeResume(loaded, {"b"}, "user").ok()) << "may be withdrawn at any time";
  EXPECT_TRUE(judgeResume(loaded, {"d"}, "fault").ok());
  EXPECT_EQ(judgeResume(loaded, {"d"}, "fault: it threw").cause(), Cause::UnknownName);
  EXPECT_EQ(judgeResume(loaded, {"a"}, "fault").cause(), Cause::UnknownName);
  EXPECT_EQ(judgeResume(loaded, {}, "supper").cause(), Cause::UnknownName);
  const Status status = judgeResume(loaded, {"a", "b"}, "lunch");
  EXPECT_EQ(status.cause(), Cause::UnknownName);
  EXPECT_NE(status.message().find("b for no reason"), std::string::npos) << status.message();
}

}  // namespace
}  // namespace coglab_controllers
