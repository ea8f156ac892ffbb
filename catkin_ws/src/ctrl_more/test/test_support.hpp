#pragma once

#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Core>

#include "ctrl_more/feedback_controllers_manager.hpp"

namespace ctrl_more {

/// Folder of the libraries in test/plugins.
inline const std::string kPlugins = CTRL_MORE_TEST_PLUGIN_DIR;

/// A controller put together in a test: a description and three functions.
class TestController : public FeedbackController {
 public:
  Description description;
  std::function<void(TestController&, Setup&)> on_initialize;
  std::function<void(TestController&, const Cycle&, const RobotStates&, const ControlStates&,
                     ModifiedControlStates&)>
      on_update;
  /// In place of on_update, where nothing else is needed.
  std::function<void(TestController&, ModifiedControlStates&)> on_write;
  int updates = 0;
  int resets = 0;
  int gains_changes = 0;
  Modify<> out;
  Read<> in;
  Gain gain_handle;

  TestController() {
    description.type = "TestController";
    description.summary = "adds to a reference";
  }
  Description describe() const override { return description; }
  void initialize(Setup& setup) override {
    if (on_initialize) on_initialize(*this, setup);
  }
  void update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
              ModifiedControlStates& modified) override {
    ++updates;
    if (on_write) {
      on_write(*this, modified);
    } else if (on_update) {
      on_update(*this, cycle, robot, original, modified);
    }
  }
  void reset() override { ++resets; }
  void gainsChanged() override { ++gains_changes; }
  using FeedbackController::fail;
  using FeedbackController::gain;
  using FeedbackController::log;
  using FeedbackController::scalar;
};

/// A controller that adds a constant to the x of a pose (or of a vector) each cycle.
inline std::unique_ptr<TestController> adder(const std::string& container, const std::string& key,
                                             double amount) {
  auto c = std::make_unique<TestController>();
  const ControlContainer where = container == "pose"  ? ControlContainer::TaskSpaceReferencePose
                                 : container == "vel" ? ControlContainer::TaskSpaceReferenceVel
                                 : container == "com" ? ControlContainer::CentreOfMass
                                                      : ControlContainer::JointSpaceReference;
  if (where == ControlContainer::JointSpaceReference) c->description.stage = Stage::Joint;
  c->description.modifies(where, key).in("m").frameOf("base").about("x is shifted");
  c->on_initialize = [key](TestController& self, Setup& setup) { self.out = setup.modify(key); };
  c->on_update = [amount](TestController& self, const Cycle&, const RobotStates&,
                          const ControlStates&,
                          ModifiedControlStates& modified) { modified[self.out][0] += amount; };
  return c;
}

/// Stores and a manager with a clock, for tests that step cycles by hand.
struct Rig {
  Logger logger;
  RobotStates robot{&logger};
  ControlStates control{7, 0.005, &logger};
  ManagerOptions options;
  std::unique_ptr<FeedbackControllersManager> manager;
  Cycle cycle{0, 0.005, 0};

  explicit Rig(double blend_s = 0.0, bool timed = false, bool check_undeclared = true) {
    options.blend_s = blend_s;
    options.timed = timed;
    options.check_undeclared = check_undeclared;
    control.declare(ControlContainer::TaskSpaceReferencePose, "ee", 7, "m, 1", "base");
    control.declare(ControlContainer::TaskSpaceReferenceVel, "ee", 6, "m/s, rad/s", "base");
    control.declare(ControlContainer::JointSpaceReference, "Velocity", 7, "rad/s", "joint");
    manager = std::make_unique<FeedbackControllersManager>(robot, control, options, &logger);
  }

  /// Adds a controller and keeps a pointer to it.
  TestController* add(std::unique_ptr<TestController> controller, const std::string& name,
                      bool enabled = true, ControllerEntry entry = {}) {
    TestController* raw = controller.get();
    entry.enabled = enabled;
    const Status status = manager->addController(std::move(controller), name, entry);
    EXPECT_TRUE(status) << status.message();
    return raw;
  }

  /// References of the motion controller, the same each cycle.
  void setReferences(double x = 0.0) {
    Eigen::VectorXd pose(7), velocity = Eigen::VectorXd::Zero(6), joints(7);
    pose << x, 0.2, 0.3, 0, 0, 0, 1;
    joints.setConstant(0.1);
    control.setTaskSpaceReferencePose("ee", pose);
    control.setTaskSpaceReferenceVel("ee", velocity);
    control.setJointSpaceReference("Velocity", joints);
    control.setCoM(Eigen::Vector3d::Zero());
    control.setCoMVelocity(Eigen::Vector3d::Zero());
    control.setZMP(Eigen::Vector3d::Zero());
    control.setPelvisOrientation(0.0, 0.0, 0.0);
  }

  /// Steps whole cycles, references set afresh before each.
  void step(int cycles = 1, double x = 0.0) {
    for (int i = 0; i < cycles; ++i) {
      setReferences(x);
      cycle.now_ns += 5000000;
      ++cycle.number;
      manager->update(cycle, robot, control);
    }
  }

  Eigen::VectorXd pose() const {
    Eigen::VectorXd value;
    control.getTaskSpaceReferencePose("ee", value);
    return value;
  }
  Eigen::VectorXd twist() const {
    Eigen::VectorXd value;
    control.getTaskSpaceReferenceVel("ee", value);
    return value;
  }
  Eigen::VectorXd joints() const {
    Eigen::VectorXd value;
    control.getJointSpaceReference("Velocity", value);
    return value;
  }
};

/// Collects drained records.
class ListSink : public LogSink {
 public:
  void write(const LogRecord& record) override { lines.push_back(record.toLine()); }
  std::vector<std::string> lines;
  bool contains(const std::string& text) const {
    for (const std::string& line : lines) {
      if (line.find(text) != std::string::npos) return true;
    }
    return false;
  }
};

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

inline Eigen::VectorXd vectorOf(std::initializer_list<double> values) {
  Eigen::VectorXd v(static_cast<Eigen::Index>(values.size()));
  std::copy(values.begin(), values.end(), v.data());
  return v;
}

}  // namespace ctrl_more
