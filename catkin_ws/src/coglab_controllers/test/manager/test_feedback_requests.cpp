// Valid fields of a request to the feedback controllers, by FeedbackSelect.srv.
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

TEST(FeedbackRequests, AnUnprintableReasonIsRefusedAndNotPrinted) {
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

TEST(FeedbackRequests, AnEmptyNameDoesNotMeanAllControllers) {
  EXPECT_TRUE(judgeNames({}).ok());
  EXPECT_TRUE(judgeNames({"a", "a", "b"}).ok()) << "a name given twice counts once";
  EXPECT_EQ(judgeNames({""}).cause(), Cause::InvalidArgument);
  EXPECT_NE(judgeNames({"a", ""}).message().find("names[1]"), std::string::npos);
}

TEST(FeedbackRequests, OnlyAPresentReasonCanBeWithdrawn) {
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
  EXPECT_NE(status.message().find("b for no"), std::string::npos) << status.message();
}

}  // namespace
}  // namespace coglab_controllers
