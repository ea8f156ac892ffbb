// What a declaration must agree with before its controller is taken: in itself, and with the
// signals that are there.
#include "ctrl_more/docs/documentation.hpp"
#include "ctrl_more/loading/controller_instance.hpp"
#include "ctrl_more/feedback_controller.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

using Way = std::function<void(Description&)>;

std::vector<std::string> faultsOf(const Way& way, Stage stage = Stage::Task) {
  Description d;
  d.type = "X";
  d.stage = stage;
  way(d);
  return d.faults();
}

TEST(Declaration, WhatIsRightHasNoFaults) {
  const std::vector<Way> right = {
      [](Description& d) { d.gain("k", 3.0).range(1.0, 3.0); },
      [](Description& d) { d.gain("k", 1.0).range(1.0, 3.0); },
      [](Description& d) { d.gain("k", 0).vector(3, 2.0); },
      [](Description& d) { d.setting("imu", "x"), d.measured("imu").keyFrom("imu"); },
      [](Description& d) { d.measured("imu").maxAge(1e-6); },
      [](Description& d) { d.measured("imu"), d.estimated("imu"); },
      [](Description& d) { d.modifies(ControlContainer::OtherReference, "x"); },
      [](Description& d) { d.reads(ControlContainer::JointSpaceReference, "Velocity"); },
  };
  for (std::size_t i = 0; i < right.size(); ++i) {
    EXPECT_TRUE(faultsOf(right[i]).empty()) << i << ": " << faultsOf(right[i]).front();
  }
  const auto joint = [](ControlContainer container) {
    return faultsOf([&](Description& d) { d.modifies(container, "Velocity"); }, Stage::Joint);
  };
  EXPECT_TRUE(joint(ControlContainer::JointSpaceReference).empty());
  EXPECT_TRUE(joint(ControlContainer::OtherReference).empty()) << "in both stages";
  EXPECT_EQ(joint(ControlContainer::Zmp).size(), 1u);
}

TEST(Declaration, WhatIsWrongHasOneSentenceEach) {
  const std::vector<std::pair<Way, std::string>> wrong = {
      {[](Description& d) { d.type = ""; }, "no type"},
      {[](Description& d) { d.gain("", 1.0); }, "has no name"},
      {[](Description& d) { d.gain("k", 1.0).size = 2; }, "as many initial values"},
      {[](Description& d) { d.gain("k", 1.0).size = 0; }, "as many initial values"},
      {[](Description& d) { d.gain("k", 3.1).range(1.0, 3.0); }, "outside its range"},
      {[](Description& d) { d.gain("k", 0.9).range(1.0, 3.0); }, "outside its range"},
      {[](Description& d) { d.gain("k", 1.0), d.setting("k", "a"); }, "'k' twice"},
      {[](Description& d) { d.state("s"), d.state("s"); }, "'s' twice"},
      {[](Description& d) { d.measured("imu"), d.measured("imu"); }, "twice"},
      {[](Description& d) { d.setting("other", "x"), d.measured("imu").keyFrom("imu"); },
       "no text setting"},
      {[](Description& d) {
         d.setting("imu", std::vector<double>{1}), d.measured("imu").keyFrom("imu");
       },
       "no text setting"},
      {[](Description& d) { d.measured("imu").maxAge(0.0); }, "age > 0"},
      {[](Description& d) { d.modifies(ControlContainer::JointSpaceReference, "Velocity"); },
       "task stage cannot modify jointSpaceReference"},
  };
  for (const auto& each : wrong) {
    const std::vector<std::string> found = faultsOf(each.first);
    ASSERT_EQ(found.size(), 1u) << each.second;
    EXPECT_TRUE(contains(found[0], each.second)) << found[0];
  }
}

TEST(Declaration, EmptyFieldsAreNamed) {
  Description d;
  d.type = "X";
  for (std::string* text : {&d.summary, &d.use, &d.when, &d.limitations, &d.law, &d.source}) {
    *text = "said";
  }
  EXPECT_TRUE(d.emptyFields().empty());
  d.setting("mode", "a").about("a text needs no unit");
  d.state("s").in("1").about("a state");
  EXPECT_TRUE(d.emptyFields().empty());
  d.setting("height", std::vector<double>{1.0}).about("a number does");
  d.gain("k", 1.0).about("so does a gain");
  d.measured("imu").in("rad").about("has no frame");
  const std::vector<std::string> expected = {"X: frame of signal 'imu' is empty",
                                             "X: unit of gain 'k' is empty",
                                             "X: unit of setting 'height' is empty"};
  EXPECT_EQ(d.emptyFields(), expected);
}

TEST(Declaration, RangesWithoutAnEndAreShownAsSuch) {
  Description d;
  d.gain("both", 1.0).range(0.5, 2.0).in("m").about("x");
  d.gain("above", 1.0).range(0.5, kUnlimited).in("m").about("x");
  d.gain("below", 1.0).range(-kUnlimited, 2.0).in("m").about("x");
  d.gain("any", 1.0).in("m").about("x");
  const std::string page = documentationPage(d), file = configurationTemplate(d);
  for (const std::string row :
       {"| `both` | 1 | m | 0.5 to 2 | 1 |", "| `above` | 1 | m | >= 0.5 | 1 |",
        "| `below` | 1 | m | <= 2 | 1 |", "| `any` | 1 | m | any | 1 |"}) {
    EXPECT_TRUE(contains(page, row)) << row << "\n" << page;
  }
  EXPECT_TRUE(contains(file, "above: 1  # [m] >= 0.5; x\n")) << file;
}

TEST(Declaration, PlotOfAControllerThatIsNotLoadedShowsWhatIsDeclared) {
  TestController c;
  c.setName("mine");
  c.description.measured("q").in("rad").frameOf("joint").about("any size");
  c.description.measured("imu").size(9).size(10).in("rad").frameOf("imu").about("two sizes");
  c.description.modifies(ControlContainer::Zmp, "zmp").in("m").frameOf("w").about("three");
  c.description.gain("k", 1.0).in("1").about("x");
  c.setGains({{"k", {2.5}}});
  std::ostringstream out;
  c.plot(out);
  for (const char* part : {"measuredData/q [any]", "measuredData/imu [9 or 10]", "age any",
                           "zmp/zmp [3]", "k = 2.5 1 (any)"}) {
    EXPECT_TRUE(contains(out.str(), part)) << part << "\n" << out.str();
  }
}

// What happens to a controller that asks for a signal by `ask`.
Status loaded(Rig& rig, const Way& way, const std::function<void(ctrl_more::Setup&)>& ask) {
  auto c = std::make_unique<TestController>();
  way(c->description);
  c->on_initialize = [&ask](TestController&, ctrl_more::Setup& setup) { ask(setup); };
  return rig.manager->addController(std::move(c), "c");
}

TEST(Signals, GetTheSizeThatIsThereIfItIsAllowed) {
  const Way two = [](Description& d) { d.measured("imu").size(9).size(10); };
  const auto read = [](ctrl_more::Setup& setup) { setup.read("imu"); };
  for (const int size : {7, 9, 10}) {
    Rig rig;
    rig.robot.declare(RobotSource::Measured, "imu", size);
    const Status status = loaded(rig, two, read);
    EXPECT_EQ(status.ok(), size != 7) << status.message();
    if (size == 7) EXPECT_TRUE(contains(status.message(), "size 7")) << status.message();
    if (size == 7) EXPECT_TRUE(contains(status.message(), "9 or 10")) << status.message();
  }
  Rig rig;
  EXPECT_TRUE(contains(loaded(rig, two, read).message(), "declare it before"));
  EXPECT_TRUE(
      contains(loaded(rig, two, [](ctrl_more::Setup& setup) { setup.read("imu", 8); }).message(),
               "size 8 was asked for, but 9 or 10 is declared"));
  EXPECT_TRUE(loaded(rig, two, [](ctrl_more::Setup& setup) { setup.read("imu", 10); }));
  EXPECT_EQ(rig.robot.find(RobotSource::Measured, "imu").size(), 10);
}

TEST(Signals, AnySizeThatIsThereIsTakenWhereNoneIsDeclared) {
  Rig rig;
  rig.control.declare(ControlContainer::OtherReference, "horizon", 4);
  const Status status = loaded(
      rig, [](Description& d) { d.modifies(ControlContainer::OtherReference, "horizon"); },
      [](ctrl_more::Setup& setup) { EXPECT_EQ(setup.modify("horizon").size(), 4); });
  EXPECT_TRUE(status) << status.message();
}

TEST(Signals, AReferenceIsFetchedWithoutItsSizeToo) {
  Rig rig;
  const Status status = loaded(
      rig, [](Description& d) { d.reads(ControlContainer::TaskSpaceReferencePose, "ee"); },
      [](ctrl_more::Setup& setup) {
        EXPECT_EQ(setup.reference("ee").size(), 7);
        EXPECT_TRUE(setup.reference("ee").valid());
        EXPECT_EQ(setup.joints(), 7);
        EXPECT_EQ(setup.period(), 0.005);
      });
  EXPECT_TRUE(status) << status.message();
}

FeedbackController* makeNothing() { return nullptr; }
FeedbackController* makeOne() {
  auto one = std::make_unique<TestController>();
  return one.release();
}

TEST(LinkedTypes, AreMadeByNameAndWhatIsMadeMustBeIt) {
  const PrototypeRegistration nothing("Nothing", &makeNothing), one("TestController", &makeOne),
      other("Other", &makeOne);
  EXPECT_NE(makeController("", "TestController").controller, nullptr);
  const auto refusal = [](const std::string& type) -> std::string {
    try {
      makeController("", type);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_TRUE(contains(refusal("Nothing"), "returned nothing")) << refusal("Nothing");
  EXPECT_TRUE(contains(refusal("Other"), "describes itself as 'TestController'"));
  EXPECT_TRUE(contains(refusal("TestControler"), "the program has no controller of type"));
  EXPECT_TRUE(contains(refusal("TestControler"), "did you mean 'TestController'"));
  EXPECT_FALSE(prototypes().insert({"Empty", nullptr}));
  const auto refused = prototypes().takeRefused();
  ASSERT_EQ(refused.size(), 1u);
  EXPECT_TRUE(contains(refused[0].clause, "without a maker"));
}

}  // namespace
}  // namespace ctrl_more
