// The file of signals, and their path into the control cycle.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <vector>

#include "virtual_robot.hpp"

namespace coglab_controllers {
namespace {

using ctrl_more::ConfigError;
using ctrl_more::RobotSource;

const std::string kImu =
    "topic: imu, type: sensor_msgs/Imu, key: imu, field: angular_velocity, max_age: 0.05";

SignalFile read(const std::string& text) {
  return readSignals(ctrl_more::ConfigNode::fromText(text, "signals.yaml"));
}

std::string refusal(const std::string& text) {
  try {
    read(text);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "taken";
}

std::string fileOf(const std::string& name, const std::string& text) {
  const std::string path = ::testing::TempDir() + "/" + name;
  std::ofstream(path) << text;
  return path;
}

SignalMessage message(const std::vector<double>& numbers, std::int64_t stamp_ns) {
  SignalMessage message;
  message.stamp_ns = stamp_ns;
  message.fields.resize(3, {numbers.data(), numbers.size()});
  return message;
}

TEST(SignalFile, WrongRowsAreRefusedWithTheLineAndWhatToDo) {
  const auto in = [](const std::string& row) { return refusal("in:\n- {" + row + "}\n"); };
  const std::pair<std::string, std::string> cases[] = {
      {in("topic: imu, type: sensor_msgs/Imuu, key: i, field: orientation, max_age: 1"),
       "did you mean 'sensor_msgs/Imu'?"},
      {in("topic: imu, type: sensor_msgs/Imu, key: i, field: orientatoin, max_age: 1"),
       "did you mean 'orientation'?"},
      {in("topic: imu, type: sensor_msgs/Imu, key: i, field: 'orientation[a]', max_age: 1"),
       "orientation 'a'"},
      {in("topic: imu, type: sensor_msgs/Imu, key: i, field: orientation, max_age: 1, size: 3"),
       "4 numbers"},
      {in("topic: j, type: sensor_msgs/JointState, key: j, field: position, max_age: 1"),
       "needs `size`"},
      {in("topic: j, type: sensor_msgs/JointState, key: j, field: [position, velocity], size: 4, "
          "max_age: 1"),
       "stands alone"},
      {in("topic: imu, type: sensor_msgs/Imu, key: i, field: orientation"), "needs `max_age`"},
      {in("topic: imu, type: sensor_msgs/Imu, key: i, field: orientation, max_age: .nan"),
       "max_age"},
      {in("topic: 'im u', type: sensor_msgs/Imu, key: i, field: orientation, max_age: 1"),
       "'im u' is no name"},
      {in("topic: a, type: std_msgs/Float64MultiArray, key: a, field: 'data[x]', max_age: 1"),
       "no index"},
      {in("topic: a, type: std_msgs/Float64MultiArray, key: a, field: data, size: 2, max_age: 1, "
          "stamp: header"),
       "has no header"},
      {in(kImu + ", sorce: measured"), "did you mean 'source'?"},
      {refusal("in:\n- {" + kImu + "}\n- {" + kImu + "}\n"), "rows write measuredData/imu"},
      {refusal("out:\n- {topic: o, type: geometry_msgs/PoseStamped, value: "
               "taskSpaceReferenceVel/ee}\n"),
       "use std_msgs/Float64MultiArray"},
      {refusal("out:\n- {topic: o, type: std_msgs/Float64MultiArray, value: taskSpace/ee}\n"),
       "unknown container"},
      {refusal("out:\n- {topic: o, type: std_msgs/Float64MultiArray, value: correction/a/b}\n"),
       "correction/CONTROLLER/CONTAINER/KEY"},
      {refusal("in:\n- {" + kImu +
               "}\nout:\n- {topic: imu, type: std_msgs/Float64MultiArray, value: state/a}\n"),
       "row of signals.yaml:2"},
      {in("topic: '~imu', type: sensor_msgs/Imu, key: i, field: orientation, max_age: 1"),
       "without ~"},
      {refusal("inn: []\n"), "did you mean 'in'?"}};
  for (const auto& [text, words] : cases) {
    EXPECT_NE(text.find(words), std::string::npos) << "'" << text << "' lacks '" << words << "'";
    EXPECT_EQ(text.rfind("signals.yaml:", 0), 0u) << text;
  }
  const std::string both = refusal(
      "in:\n- {topic: lab/x, type: sensor_msgs/Imu, key: a, field: orientation, max_age: 1}\n"
      "- {topic: /lab/x, type: geometry_msgs/PoseStamped, key: b, field: pose, max_age: 1}\n");
  EXPECT_EQ(both.rfind("signals.yaml:3: topic /lab/x", 0), 0u) << both;
  for (const char* const name :
       {"geometry_msgs/PoseStamped", "sensor_msgs/Imu", "row of signals.yaml:2"}) {
    EXPECT_NE(both.find(name), std::string::npos) << both;
  }
}

TEST(SignalFile, TheExampleIsRight) {
  const SignalFile file = readSignalFile(std::string(PACKAGE_DIR) + "/config/signals.yaml");
  EXPECT_EQ(file.in.size(), 4u);
  EXPECT_EQ(file.out.size(), 2u);
}

TEST(SignalFile, IsLoadedWholeOrNotAtAll) {
  const auto loaded = [](const std::string& text, bool& there) {
    VirtualRobot robot("signals_file: " + fileOf("signals.yaml", text));
    const auto& states = robot.manager->feedbackStage().robot();
    there = states.find(RobotSource::Measured, "imu").valid();
    const auto& errors = robot.manager->feedbackErrors();
    return errors.empty() ? std::string() : errors.front();
  };
  bool there = false;
  EXPECT_EQ(loaded("in:\n- {" + kImu + "}\n", there), "");
  EXPECT_TRUE(there);
  const std::string taken =
      loaded("in:\n- {" + kImu +
                 "}\n- {topic: p, type: "
                 "geometry_msgs/PoseStamped, key: ee, source: estimated, field: "
                 "pose, max_age: 1}\n",
             there);
  EXPECT_NE(taken.find("estimatedData/ee"), std::string::npos) << taken;
  EXPECT_NE(taken.find("writer"), std::string::npos) << taken;
  EXPECT_FALSE(there) << "nothing of the file";
}

TEST(SignalFile, TopicsAreComparedByTheirFullNames) {
  const SignalFile file = read(
      "in:\n- {topic: imu, type: sensor_msgs/Imu, key: a, field: orientation, max_age: 1}\n"
      "out:\n- {topic: lab/hand, type: geometry_msgs/PoseStamped, value: "
      "taskSpaceReferencePose/ee}\n");
  const auto refused = [&](const TopicRules& rules) {
    try {
      checkSignals(file, rules);
    } catch (const std::exception& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  TopicRules rules;
  EXPECT_EQ(refused(rules), "taken");
  rules.resolve = [](const std::string& name) { return name == "imu" ? "/lab/hand" : "/" + name; };
  EXPECT_EQ(refused(rules).rfind("signals.yaml:4: topic lab/hand", 0), 0u) << refused(rules);
  EXPECT_NE(refused(rules).find("signals.yaml:2"), std::string::npos) << refused(rules);
  rules.resolve = nullptr;
  rules.refusal = [](const std::string& topic, const std::string& type, bool out) {
    EXPECT_EQ(type, out ? "geometry_msgs/PoseStamped" : "sensor_msgs/Imu");
    return out && topic == "/lab/hand" ? "is the arm's" : "";
  };
  EXPECT_EQ(refused(rules).rfind("signals.yaml:4: topic lab/hand", 0), 0u) << refused(rules);
  EXPECT_NE(refused(rules).find("is the arm's"), std::string::npos) << refused(rules);
  rules.resolve = [](const std::string&) -> std::string { throw std::runtime_error("no name"); };
  EXPECT_EQ(refused(rules).rfind("signals.yaml:2: topic imu", 0), 0u) << refused(rules);
}

TEST(SignalFile, AnOutputOfAnUnknownSourceRefusesTheWholeFile) {
  const auto said = [](const std::string& value) {
    const std::string file = fileOf(
        "outputs.yaml",
        "in:\n- {" + kImu +
            "}\nout:\n- {topic: o, type: std_msgs/Float64MultiArray, value: " + value + "}\n");
    VirtualRobot robot("{feedback_file: " PACKAGE_DIR "/config/palm.yaml, signals_file: " + file +
                       ", plugin_paths: [" PLUGIN_DIR "]}");
    const auto& errors = robot.manager->feedbackErrors();
    const bool whole = !robot.manager->signalOutputs().empty() &&
                       !robot.manager->feedbackStage().signals().rows().empty();
    const bool none = robot.manager->signalOutputs().empty() &&
                      robot.manager->feedbackStage().signals().rows().empty();
    EXPECT_TRUE(errors.empty() ? whole : none) << value;
    return errors.empty() ? std::string("taken") : errors.front();
  };
  const std::pair<const char*, std::vector<std::string>> cases[] = {
      {"taskSpaceReferencePose/ee", {"taken"}},
      {"state/attitude/integral_x", {"taken"}},
      {"correction/attitude/taskSpaceReferencePose/ee", {"taken"}},
      {"taskSpaceReferencePose/hand",
       {"outputs.yaml:4: ", "reference 'taskSpaceReferencePose/hand'",
        "taskSpaceReferencePose/ee"}},
      {"state/atitude", {"outputs.yaml:4: ", "'atitude'", "attitude, ee_admittance, joint_limits"}},
      {"state/attitude/integral", {"state of 'attitude' 'integral'", " integral_x, "}},
      {"correction/attitude/taskSpaceReferenceVel/ee",
       {"correction by 'attitude'", "'taskSpaceReferenceVel/ee'", " taskSpaceReferencePose/ee"}}};
  for (const auto& [value, words] : cases) {
    const std::string sentence = said(value);
    for (const std::string& word : words) {
      EXPECT_NE(sentence.find(word), std::string::npos) << word << ": " << sentence;
    }
  }
}

TEST(SignalInputs, MessagesThatCannotBeUsedAreRefused) {
  constexpr std::int64_t kNow = 10'000'000'000, kMs = 1'000'000;
  ctrl_more::RobotStates robot;
  SignalInputs inputs;
  ASSERT_TRUE(inputs.add(read("in:\n- {" + kImu + ", frame: hand}\n").in, robot).ok());
  const auto post = [&](const std::vector<double>& numbers, std::int64_t stamp,
                        const std::string& frame = "hand") {
    SignalMessage bad = message(numbers, stamp);
    bad.frame = frame;
    return inputs.post(0, bad, kNow).refusal;
  };
  EXPECT_EQ(post({1, 2, 3}, kNow, "base"), SignalRefusal::Frame);
  EXPECT_EQ(post({1, 2}, kNow), SignalRefusal::Size);
  EXPECT_EQ(post({}, kNow), SignalRefusal::Missing);
  EXPECT_EQ(post({1, std::nan(""), 3}, kNow), SignalRefusal::NotFinite);
  EXPECT_EQ(post({1, 2, 3}, 0), SignalRefusal::NoStamp);
  EXPECT_EQ(post({1, 2, 3}, kNow - 51 * kMs), SignalRefusal::Past);
  EXPECT_EQ(post({1, 2, 3}, std::numeric_limits<std::int64_t>::min() / 2), SignalRefusal::Past);
  EXPECT_EQ(post({1, 2, 3}, kNow + 51 * kMs), SignalRefusal::Future);
  inputs.deliver(robot, kNow);
  const auto imu = robot.find(RobotSource::Measured, "imu");
  EXPECT_EQ(robot.stamp(imu), ctrl_more::kNeverWritten) << "nothing of them arrived";
  EXPECT_EQ(post({1, 2, 3}, kNow - 2 * kMs), SignalRefusal::None);
  EXPECT_EQ(post({4, 5, 6}, kNow - 3 * kMs), SignalRefusal::Past) << "an older one came later";
  inputs.deliver(robot, kNow);
  EXPECT_EQ(robot.stamp(imu), kNow - 2 * kMs);
  EXPECT_EQ(robot.view(imu)[2], 3.0);
  inputs.deliver(robot, kNow + 48 * kMs);
  EXPECT_NE(robot.stamp(imu), ctrl_more::kNeverWritten);
  inputs.deliver(robot, kNow + 49 * kMs);
  EXPECT_EQ(robot.stamp(imu), ctrl_more::kNeverWritten) << "absent after its largest age";
}

// Many trackers publish a quaternion of zeros for an unknown orientation.
TEST(SignalInputs, OrientationsThatAreNoUnitQuaternionsAreRefused) {
  constexpr std::int64_t kNow = 10'000'000'000;
  ctrl_more::RobotStates robot;
  SignalInputs inputs;
  const std::string row = "topic: p, type: geometry_msgs/PoseStamped, max_age: 1, ";
  ASSERT_TRUE(inputs
                  .add(read("in:\n- {" + row + "key: a, field: pose}\n- {" + row +
                            "key: b, field: position}\n")
                           .in,
                       robot)
                  .ok());
  const auto post = [&](std::size_t index, double w) {
    const std::vector<double> pose = {0.1, 0.2, 0.3, 0.0, 0.0, 0.0, w};
    SignalMessage message;
    message.stamp_ns = kNow;
    message.fields = {{pose.data(), 3}, {pose.data() + 3, 4}, {pose.data(), 7}};
    return inputs.post(index, message, kNow);
  };
  EXPECT_EQ(post(0, 0.0).refusal, SignalRefusal::Missing);
  EXPECT_NE(post(0, 0.0).text.find("quaternion in pose"), std::string::npos);
  EXPECT_EQ(post(0, 2.0).refusal, SignalRefusal::Missing);
  EXPECT_EQ(post(1, 0.0).refusal, SignalRefusal::None) << "its position is known";
  EXPECT_EQ(post(0, 1.0).refusal, SignalRefusal::None);
}

/// A controller that needs the signal `imu`, and notes its age in each cycle.
class AgeProbe : public ctrl_more::FeedbackController {
 public:
  explicit AgeProbe(std::vector<std::int64_t>* ages) : ages_(ages) {}
  ctrl_more::Description describe() const override {
    ctrl_more::Description d;
    d.type = "AgeProbe";
    d.summary = "Notes the age of a signal.";
    d.use = d.when = d.limitations = d.law = d.source = "For this test.";
    d.stage = ctrl_more::Stage::Task;
    d.measured("imu").size(3).in("rad/s").about("what it needs");
    return d;
  }
  void initialize(ctrl_more::Setup& setup) override { imu_ = setup.read<3>("imu"); }
  void update(const ctrl_more::Cycle& cycle, const ctrl_more::RobotStates& robot,
              const ctrl_more::ControlStates&, ctrl_more::ModifiedControlStates&) override {
    ages_->push_back(cycle.now_ns - robot.stamp(imu_));
  }

 private:
  std::vector<std::int64_t>* ages_;
  ctrl_more::Read<3> imu_;
};

TEST(SignalInputs, ControllersGetASignalWithinTwoCyclesAndWaitWhileItIsAbsent) {
  VirtualRobot robot("signals_file: " + fileOf("imu.yaml", "in:\n- {" + kImu + "}\n"));
  robot.loadBoth("ptp");
  auto& feedback = robot.manager->feedback();
  std::vector<std::int64_t> ages;
  ASSERT_TRUE(feedback.addController(std::make_unique<AgeProbe>(&ages), "probe").ok());
  ASSERT_TRUE(feedback.enable("probe").ok());
  const auto status = [&] { return feedback.status("probe"); };
  robot.run(0.1);
  EXPECT_EQ(status().activity, ctrl_more::Activity::Waiting);
  EXPECT_EQ(status().waiting_for, "measuredData/imu");

  SignalInputs& inputs = robot.manager->feedbackStage().signals();
  for (int i = 0; i < 1000; ++i) {  // a sensor of 170 Hz beside the cycle of 200 Hz
    const std::int64_t before = robot.now_ns;
    robot.tick();
    const std::int64_t period = 5'900'000, stamp = robot.now_ns / period * period;
    if (stamp <= before) continue;
    ASSERT_EQ(inputs.post(0, message({1, 2, 3}, stamp), robot.now_ns).refusal, SignalRefusal::None);
  }
  ASSERT_GT(ages.size(), 900u);
  std::sort(ages.begin(), ages.end());
  const double p99 = 1e-9 * static_cast<double>(ages[ages.size() * 99 / 100]);
  RecordProperty("age_p99_ms", std::to_string(1e3 * p99));
  // Up to one period of the sensor passes before its next message: the way takes the rest.
  EXPECT_LE(p99 - 0.0059, 2 * 0.005);

  robot.run(0.1);  // the topic has stopped
  EXPECT_EQ(status().activity, ctrl_more::Activity::Waiting);
  EXPECT_EQ(status().waiting_for, "measuredData/imu");
  ASSERT_EQ(inputs.post(0, message({1, 2, 3}, robot.now_ns), robot.now_ns).refusal,
            SignalRefusal::None);
  robot.tick();
  EXPECT_EQ(status().activity, ctrl_more::Activity::Running);
}

}  // namespace
}  // namespace coglab_controllers
