// Managers beside the feedback controllers, from the file of the central module.
#include <fstream>

#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

std::string fileOf(const std::string& text) {
  const std::string path = ::testing::TempDir() + "/central.yaml";
  std::ofstream(path) << text;
  return path;
}

/// Halves the twist reference of the motion controller.
struct Half : ctrl_more::Manager {
  std::string name_ = "half";
  const std::string& name() const override { return name_; }
  void beginCycle(const ctrl_more::Cycle&) noexcept override {}
  void updateStage(ctrl_more::Stage stage, const ctrl_more::RobotStates&,
                   ctrl_more::ControlStates& control) noexcept override {
    if (stage == ctrl_more::Stage::Joint) {
      control.view(control.find(ctrl_more::ControlContainer::JointSpaceReference, "Velocity")) *=
          0.5;
    }
  }
};

const bool registered = ctrl_more::CentralModule::registerManager(
    "Half", [](const std::string&, const ctrl_more::ConfigNode&, ctrl_more::RobotStates&,
               ctrl_more::ControlStates&, ctrl_more::Logger*) { return std::make_unique<Half>(); });

/// Lowers the speed limit to 0.1 m/s, and to 0 from the 200th cycle on for 200 cycles.
struct Careful : ctrl_more::Manager {
  std::string name_ = "careful";
  int cycles = 0;
  const std::string& name() const override { return name_; }
  void beginCycle(const ctrl_more::Cycle&) noexcept override { ++cycles; }
  void updateStage(ctrl_more::Stage stage, const ctrl_more::RobotStates&,
                   ctrl_more::ControlStates& control) noexcept override {
    if (stage != ctrl_more::Stage::Task) return;
    const bool stands = cycles >= 200 && cycles < 400;
    control.view(control.find(ctrl_more::ControlContainer::OtherReference, "speed_limit"))[0] =
        stands ? 0.0 : 0.1;
  }
};

const bool careful_registered = ctrl_more::CentralModule::registerManager(
    "Careful",
    [](const std::string&, const ctrl_more::ConfigNode&, ctrl_more::RobotStates&,
       ctrl_more::ControlStates&, ctrl_more::Logger*) { return std::make_unique<Careful>(); });

double peakSpeed(VirtualRobot& robot) {
  robot.loadBoth("ptp");
  robot.ptp().add({{-1.2, -0.6, 1.5, 1.7, 0.2, 0.2, 0.8}, {}, {}});
  double peak = 0.0;
  for (int i = 0; i < 200; ++i) peak = std::max(peak, robot.tick().velocity.cwiseAbs().maxCoeff());
  return peak;
}

TEST(CentralFile, ItsManagersRunOnTheRobotInTheirOrder) {
  ASSERT_TRUE(registered);
  VirtualRobot plain;
  VirtualRobot robot("central_file: " + fileOf("managers: [half, feedback]\nhalf: {type: Half}\n"
                                               "feedback: {type: Feedback}\n"));
  ASSERT_TRUE(robot.manager->feedbackErrors().empty()) << robot.manager->feedbackErrors().front();
  EXPECT_EQ(robot.manager->feedbackStage().central().managers(),
            (std::vector<std::string>{"half", "feedback"}));
  EXPECT_LT(peakSpeed(robot), 0.8 * peakSpeed(plain));
}

TEST(SpeedLimit, OfAManagerSlowsHandAndClockAndStopsBoth) {
  ASSERT_TRUE(careful_registered);
  VirtualRobot robot("central_file: " +
                     fileOf("managers: [feedback, careful]\ncareful: {type: Careful}\n"
                            "feedback: {type: Feedback}\n"));
  robot.loadBoth("dmp");
  const Vector3 goal = robot.hand().position + Vector3(0.1, 0.1, 0.1);
  robot.see("human_hand", goal);
  ASSERT_TRUE(VirtualRobot::ok(robot.dmp().execute(robot.reach())));
  int standing = 0, cycles = 0, explained = 0;
  for (; robot.state() != MotionState::Reached && cycles < 2000; ++cycles) {
    robot.see("human_hand", goal);
    robot.tick();
    ASSERT_NE(robot.state(), MotionState::Aborted) << robot.reason();
    EXPECT_LE(robot.handVelocity().norm(), 0.1 + 1e-6);
    standing += robot.command.velocity.isZero(1e-9) && cycles > 50 ? 1 : 0;
    explained += robot.manager->report().reason.code() == ReasonCode::WaitsForPerson ? 1 : 0;
  }
  EXPECT_EQ(robot.state(), MotionState::Reached) << "it goes on where it waited";
  EXPECT_GE(standing, 190);
  EXPECT_EQ(explained, 200) << "the report has the reason, as long as it stands for it";
  EXPECT_LT((robot.hand().position - goal).norm(), 0.01);
}

TEST(CentralFile, WrongOnesAreRefusedAndFeedbackStays) {
  const auto refusal = [](const std::string& text) {
    VirtualRobot robot("central_file: " + fileOf(text));
    EXPECT_EQ(robot.manager->feedbackStage().central().managers(),
              std::vector<std::string>{"feedback"});
    const auto& errors = robot.manager->feedbackErrors();
    return errors.size() == 1 ? errors.front() : "";
  };
  const auto has = [](const std::string& text, const std::string& words) {
    return text.find(words) != std::string::npos ? "" : text + " lacks " + words;
  };
  const std::string tail = ", f]\nf: {type: Feedback}\n";
  EXPECT_EQ(has(refusal("managers: [x" + tail + "x: {type: Haf}\n"), "did you mean 'Half'"), "");
  EXPECT_EQ(has(refusal("managers: [x" + tail + "x: {type: X, libPath: libnowhere.so}\n"),
                "libnowhere.so"),
            "");
  EXPECT_EQ(has(refusal("managers: [x" + tail +
                        "x: {type: X, libPath: " PLUGIN_DIR "/libcoglab_dmp_controller.so}\n"),
                "registers no manager"),
            "");
  EXPECT_EQ(has(refusal("managers: [half]\nhalf: {type: Half}\n"), "type Feedback"), "");
}

}  // namespace
}  // namespace coglab_controllers
