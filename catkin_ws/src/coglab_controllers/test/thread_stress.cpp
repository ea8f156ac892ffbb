// Requests against the control thread, for the sanitizers: built and run by test_sanitizers.py with
// the sources of the cores, so that everything in it is instrumented. Arguments: seconds, folder of
// coglab_controllers, folder of lwr_description.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <random>
#include <sstream>
#include <thread>
#include <vector>

#include "coglab_controllers/manager/control_thread.hpp"
#include "coglab_controllers/manager/controller_manager.hpp"
#include "coglab_controllers/plugins/dmp_controller.hpp"
#include "coglab_controllers/plugins/ptp_controller.hpp"
#include "coglab_rt/joint_limits_table.hpp"

namespace {

using namespace coglab_controllers;

std::string readText(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// A goal that wanders, seen at the time it is asked for.
class WanderingGoal : public GoalSource {
 public:
  explicit WanderingGoal(ControllerManager*& manager) : manager_(manager) {}
  bool lookup(const std::string&, const std::string& frame, GoalObservation& goal,
              std::string& why) override {
    if (frame != "human_hand") {
      why = "no such frame";
      return false;
    }
    goal.stamp_ns = goal.frame_ns = manager_->now_ns();
    goal.position = Vector3(0.8, 0.05 * std::sin(1e-9 * static_cast<double>(goal.stamp_ns)), 0.45);
    return true;
  }

 private:
  ControllerManager*& manager_;
};

/// Shifts the reference a little.
class Shift : public ctrl_more::FeedbackController {
 public:
  ctrl_more::Description describe() const override {
    ctrl_more::Description d;
    d.type = "Shift";
    d.modifies(ctrl_more::ControlContainer::TaskSpaceReferencePose, "ee")
        .in("m, quaternion x y z w")
        .frameOf("base")
        .about("shifted by a millimetre");
    return d;
  }
  void initialize(ctrl_more::Setup& setup) override { pose_ = setup.modify<ctrl_more::Pose>("ee"); }
  void update(const ctrl_more::Cycle&, const ctrl_more::RobotStates&,
              const ctrl_more::ControlStates&, ctrl_more::ModifiedControlStates& pose) override {
    pose[pose_][0] += 0.001;
  }

 private:
  ctrl_more::Modify<ctrl_more::Pose> pose_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: thread_stress SECONDS CONTROLLERS_FOLDER DESCRIPTION_FOLDER\n");
    return 2;
  }
  const std::string package = argv[2], description = argv[3];
  MotionTypes::instance().insert(
      "stress/Dmp", {[]() -> MotionController* { return new DmpController(); }, nullptr});
  MotionTypes::instance().insert(
      "stress/Ptp", {[]() -> MotionController* { return new PtpController(); }, nullptr});
  const auto table = coglab_rt::loadJointLimits(description + "/config/joint_limits.yaml");
  ManagerSettings settings =
      readManagerSettings(YAML::Load("{dmp: {enable_ik_debug: true, goal_lost_time: 0}}"),
                          readText(description + "/urdf/lwr_ih2.urdf"), table, false);
  ctrl_more::Logger logger;
  settings.logger = &logger;
  settings.cycle.overrun_time = 0.0;
  settings.cycle.sample_timeout = 5.0;
  settings.plan_timeout = 5.0;
  ControllerManager* alive = nullptr;
  WanderingGoal goals(alive);
  ControllerManager manager(std::move(settings));
  alive = &manager;
  manager.feedback().addController(std::make_unique<Shift>(), "shift");
  manager.feedback().setProfile("dmp", {"shift"});
  manager.feedback().setProfile("ptp", {});

  coglab_rt::ArmMailboxes mailboxes;
  ControlThreadOptions options;
  options.priority = 0;
  options.stack_bytes = 16 * 1024 * 1024;  // the sanitizers take part of it
  ControlThread control(manager.cycle(), mailboxes, options);
  control.start();
  std::atomic<bool> stop{false};
  std::thread robot([&] {
    RobotSample sample;
    sample.position << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782;
    sample.cycle_time = 0.005;
    sample.block = coglab_rt::MotionBlock::None;
    VelocityCommand command;
    while (!stop) {
      mailboxes.takeVelocity(command);
      sample.position += 0.002 * command.velocity;
      sample.commanded_position = sample.position;
      sample.commanded_velocity = sample.velocity = command.velocity;
      ++sample.sequence;
      sample.controller_ns += 5'000'000;
      sample.stamp_ns = manager.now_ns();
      mailboxes.publishSample(sample);
      control.wake(true);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  });
  if (!manager.load("dmp", "stress/Dmp").success || !manager.load("ptp", "stress/Ptp").success) {
    std::fprintf(stderr, "the controllers were not loaded\n");
    std::_Exit(3);
  }
  auto& dmp = dynamic_cast<DmpController&>(*manager.motion("dmp"));
  auto& ptp = dynamic_cast<PtpController&>(*manager.motion("ptp"));
  dmp.setGoalSource(&goals);
  int loaded = 0;
  dmp.loadDmps(package + "/config/primitives.xml", loaded);

  std::atomic<int> accepted{0}, refused{0};
  const auto note = [&](bool success) { ++(success ? accepted : refused); };
  const auto serve = [&](int seed) {
    std::mt19937 random(seed);
    std::string type;
    for (int round = 0; !stop; ++round) {
      switch (random() % 10) {
        case 0:
          note(manager.switchTo(random() % 2 == 0 ? "dmp" : "ptp", type).success);
          break;
        case 1:
        case 2: {
          DmpRequest request;
          request.primitive_id = random() % 2 == 0 ? "reach_human" : "give_human";
          request.goal_frame = random() % 8 == 0 ? "nowhere" : "human_hand";
          request.orientation_control = random() % 2 == 0;
          note(dmp.execute(request).success);
          break;
        }
        case 3: {
          DmpRequest request;
          request.primitive_id = "give_human";
          request.dmp_ratio = 0.5 + 0.25 * (random() % 7);
          note(dmp.switchDmp(request).success);
          break;
        }
        case 4:
          note(
              ptp.add({{-1.4 + 0.05 * (random() % 5), -0.6, 1.5, 1.7, 0.2, 0.2, 0.8}, {}, {}}).id >=
              0);
          break;
        case 5:
          note(manager.setSpeedScale(0.25 * (random() % 6)).success);
          break;
        case 6:
          note(manager.applyProfile(random() % 2 == 0 ? "dmp" : "ptp").success);
          break;
        case 7: {
          const auto lock = manager.lockRequests();
          note((random() % 2 == 0 ? manager.feedback().enable("shift")
                                  : manager.feedback().disable("shift"))
                   .ok());
          break;
        }
        case 8:
          manager.cancel(random() % 2 == 0 ? "dmp" : "ptp", 0.2, "stress");
          break;
        default: {
          int count = 0;
          note(dmp.loadDmps(package + "/config/primitives.xml", count).success);
          std::vector<std::string> ids, types;
          manager.list(ids, types);
          manager.feedback().statusAll();
        }
      }
    }
  };
  std::vector<std::thread> services;
  for (int seed = 1; seed <= 3; ++seed) services.emplace_back(serve, seed);
  std::thread publisher([&] {  // what the publisher thread of the node does
    DmpProgress progress;
    IkDebugRecord record;
    EndedMotion end;
    while (!stop) {
      dmp.pollGoal();
      dmp.readProgress(progress);
      while (dmp.readIkDebug(record)) {
      }
      while (ptp.readEnd(end)) {
      }
      manager.report();
      manager.motionWelcome("dmp", manager.report());
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  });
  std::this_thread::sleep_for(std::chrono::duration<double>(std::atof(argv[1])));
  stop = true;
  for (std::thread& service : services) service.join();
  publisher.join();
  robot.join();
  control.stop();
  const CycleReport report = manager.report();
  std::printf("%llu cycles, %d requests accepted, %d refused\n",
              static_cast<unsigned long long>(report.samples), accepted.load(), refused.load());
  return report.samples > 100 && accepted > 50 && !report.fault ? 0 : 1;
}
