// A controller manager in virtual time with an ideal velocity robot: what the tests of the manager
// share.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "coglab_controllers/plugins/dmp_controller.hpp"
#include "coglab_controllers/plugins/ptp_controller.hpp"
#include "coglab_controllers/testing/virtual_arm.hpp"

namespace coglab_controllers {

inline const Vector3 kGoal(0.80, 0.0, 0.45);  // m, a goal within reach
inline const std::vector<double> kThere = {-1.0, -0.5, 1.2, 1.5, 0.3, 0.3, 0.6};  // rad
constexpr std::int64_t kMs = 1'000'000;                                           // ns

/// Parameters that name the plug-ins of these tests.
inline const std::string kTypes =
    "types: {test/Misbehaving: libcoglab_test_misbehaving.so, test/Twin: "
    "libcoglab_test_twin.so, test/Empty: libcoglab_test_empty.so, test/Missing: libnowhere.so, "
    "test/Other: libcoglab_test_misbehaving.so, test/Throwing: libcoglab_test_own_exception.so, "
    "test/OtherAbi: libcoglab_test_other_abi.so}, "
    "plugin_paths: [" PLUGIN_DIR "]";

/// Frames as a table.
class FrameTable : public GoalSource {
 public:
  bool lookup(const std::string&, const std::string& frame, GoalObservation& observation,
              std::string& why) override {
    const auto found = frames.find(frame);
    if (found == frames.end()) {
      why = "no such frame";
      return false;
    }
    observation = found->second;
    return true;
  }
  std::map<std::string, GoalObservation> frames;
};

/// A virtual arm with the two plug-ins of this package and a table of frames.
class VirtualRobot : public VirtualArm {
 public:
  explicit VirtualRobot(const std::string& parameters = "", double cycle = 0.005,
                        bool lockstep = true)
      : VirtualArm(DESCRIPTION_DIR, parameters, cycle, lockstep) {}

  /// Both plug-ins, the library of the package, and `active`.
  void loadBoth(const std::string& active = "dmp") {
    ASSERT_TRUE(ok(manager->load("dmp", "coglab/DmpController")));
    ASSERT_TRUE(ok(manager->load("ptp", "coglab/PtpController")));
    dmp().setGoalSource(&frames);
    int loaded = 0;
    ASSERT_TRUE(ok(dmp().loadDmps(std::string(PACKAGE_DIR) + "/config/primitives.xml", loaded)));
    ASSERT_GT(loaded, 0);
    switchTo(active);
  }

  void switchTo(const std::string& id) {
    std::string type;
    ASSERT_TRUE(ok(manager->switchTo(id, type)));
  }

  static ::testing::AssertionResult ok(const Answer& answer) {
    return answer.success ? ::testing::AssertionSuccess()
                          : ::testing::AssertionFailure() << answer.message;
  }

  DmpController& dmp() { return dynamic_cast<DmpController&>(*manager->motion("dmp")); }
  PtpController& ptp() { return dynamic_cast<PtpController&>(*manager->motion("ptp")); }

  /// A goal frame seen now.
  void see(const std::string& frame, const Vector3& position,
           const Quaternion& orientation = Quaternion::Identity()) {
    GoalObservation observation;
    observation.position = position;
    observation.orientation = orientation;
    observation.stamp_ns = observation.frame_ns = now_ns;
    frames.frames[frame] = observation;
  }

  DmpRequest reach(const std::string& primitive = "reach_human") const {
    DmpRequest request;
    request.primitive_id = primitive;
    request.goal_frame = "human_hand";
    return request;
  }

  FrameTable frames;

 private:
  void beforeCycle() override {
    if (MotionController* motion = manager->motion("dmp")) {
      static_cast<DmpController*>(motion)->pollGoal();
    }
  }
};

/// A refusal whose sentence has all these words.
inline ::testing::AssertionResult refused(const Answer& answer,
                                          const std::vector<std::string>& words) {
  if (answer.success) return ::testing::AssertionFailure() << "was not refused";
  for (const std::string& word : words) {
    if (answer.message.find(word) == std::string::npos) {
      return ::testing::AssertionFailure() << "'" << answer.message << "' lacks '" << word << "'";
    }
  }
  return ::testing::AssertionSuccess();
}

}  // namespace coglab_controllers
