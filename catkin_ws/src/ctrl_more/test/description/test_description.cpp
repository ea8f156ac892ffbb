// Checks of a declaration before its controller is loaded: consistency in itself and with the
// existing signals.
#include "ctrl_more/docs/documentation.hpp"
#include "ctrl_more/feedback_controller.hpp"
#include "ctrl_more/loading/controller_instance.hpp"
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

TEST(Declaration, EachErrorHasOneSentence) {
  const std::vector<std::pair<Way, std::string>> wrong = {
      {[](Description& d) { d.type = ""; }, "no type"},
      {[](Description& d) { d.gain("", 1.0); }, "has no name"},
      {[](Description& d) { d.gain("k", 1.0).size = 2; }, "initial values"},
      {[](Description& d) { d.gain("k", 1.0).size = 0; }, "initial values"},
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
       "modify jointSpaceReference"},
  };
  for (const auto& each : wrong) {
    const std::vector<std::string> found = faultsOf(each.first);
    ASSERT_EQ(found.size(), 1u) << each.second;
    EXPECT_TRUE(contains(found[0], each.second)) << found[0];
  }
}

// Result for a controller that requests a signal by `ask`.
Status loaded(Rig& rig, const Way& way, const std::function<void(ctrl_more::Setup&)>& ask) {
  auto c = std::make_unique<TestController>();
  way(c->description);
  c->on_initialize = [&ask](TestController&, ctrl_more::Setup& setup) { ask(setup); };
  return rig.manager->addController(std::move(c), "c");
}

TEST(Signals, UseTheExistingSizeIfItIsAllowed) {
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
  const Status eight = loaded(rig, two, [](ctrl_more::Setup& setup) { setup.read("imu", 8); });
  EXPECT_TRUE(contains(eight.message(), "size 8")) << eight.message();
  EXPECT_TRUE(contains(eight.message(), "9 or 10")) << eight.message();
  EXPECT_TRUE(loaded(rig, two, [](ctrl_more::Setup& setup) { setup.read("imu", 10); }));
  EXPECT_EQ(rig.robot.find(RobotSource::Measured, "imu").size(), 10);
}

TEST(Signals, UseAnyExistingSizeIfNoneIsDeclared) {
  Rig rig;
  rig.control.declare(ControlContainer::OtherReference, "horizon", 4);
  const Status status = loaded(
      rig, [](Description& d) { d.modifies(ControlContainer::OtherReference, "horizon"); },
      [](ctrl_more::Setup& setup) { EXPECT_EQ(setup.modify("horizon").size(), 4); });
  EXPECT_TRUE(status) << status.message();
}

FeedbackController* makeNothing() { return nullptr; }
FeedbackController* makeOne() {
  auto one = std::make_unique<TestController>();
  return one.release();
}

TEST(LinkedTypes, AreMadeByNameAndMustHaveTheDescribedType) {
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
  EXPECT_TRUE(contains(refusal("Other"), "as 'TestController'"));
  EXPECT_TRUE(contains(refusal("TestControler"), "'TestControler'"));
  EXPECT_TRUE(contains(refusal("TestControler"), "did you mean 'TestController'"));
  EXPECT_FALSE(prototypes().insert({"Empty", nullptr}));
  const auto refused = prototypes().takeRefused();
  ASSERT_EQ(refused.size(), 1u);
  EXPECT_TRUE(contains(refused[0].clause, "without a maker"));
}

}  // namespace
}  // namespace ctrl_more
