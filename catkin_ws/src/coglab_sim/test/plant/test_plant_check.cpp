/// Conditions that end a simulation of the plant: NaN, and contacts or constraints that MuJoCo
/// leaves out for lack of room; each with its message.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "coglab_sim/plant/plant.hpp"

using namespace coglab_sim;
using namespace coglab_sim::plant;

namespace {

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

/// The arm on its brakes, a box just above the board.
class PlantCheck : public ::testing::Test {
 protected:
  PlantCheck() : plant_(config()) {
    plant_.setBrakes(true);
    Pose pose;
    pose.position = Vector3d(0.45, -0.55, 0.0505);
    plant_.place(Place::World, pose);
  }

  static PlantConfig config() {
    PlantConfig config;
    config.urdf = URDF;
    config.seed = 42;
    config.home << -1.4349, -0.6086, 1.4986, 1.7048, 0.1857, 0.2152, 0.782;
    config.object.shape = "box";
    return config;
  }

  /// Error message that ends a run of `steps`; empty if it does not end.
  std::string endOf(int steps) {
    try {
      for (int i = 0; i < steps; ++i) plant_.step(Vector7::Zero());
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }

  Plant plant_;
};

}  // namespace

TEST_F(PlantCheck, NothingEndsAnObjectThatComesToRest) { EXPECT_EQ(endOf(300), ""); }

TEST_F(PlantCheck, APositionThatIsNoNumber) {
  ASSERT_EQ(endOf(5), "");
  plant_.model().data()->qpos[plant_.model().object_position] = kNoNumber;
  const std::string end = endOf(1);
  for (const char* const words : {"0.006 s", "seed 42", "no number"}) {
    EXPECT_NE(end.find(words), std::string::npos) << end;
  }
}

TEST_F(PlantCheck, AVelocityOfAFingerThatIsNoNumber) {
  ASSERT_EQ(endOf(5), "");
  plant_.model().data()->qvel[plant_.model().phalanx_velocity[3]] = kNoNumber;
  EXPECT_NE(endOf(1).find("no number"), std::string::npos);
}

/// Both lists are as long as ever in memory: the model alone says that they are shorter.
TEST_F(PlantCheck, ContactsThatAreLeftOut) {
  ASSERT_EQ(endOf(300), "");
  plant_.model().get()->nconmax = 1;
  EXPECT_NE(endOf(2).find(" 1 contacts"), std::string::npos);
}

TEST_F(PlantCheck, ConstraintsThatAreLeftOut) {
  ASSERT_EQ(endOf(300), "");
  plant_.model().get()->njmax = 2;
  EXPECT_NE(endOf(2).find(" 2 constraints"), std::string::npos);
}

/// Speeds that no body of this cell can have: m/s and rad/s of free bodies, rad/s of a joint.
TEST_F(PlantCheck, ImplausibleSpeeds) {
  const Model& model = plant_.model();
  const struct {
    int at;
    double good, bad;
    const char* who;
  } rows[] = {{model.object_velocity, 9.5, 10.5, "the object"},
              {model.object_velocity + 5, 950.0, 1100.0, "the object"},
              {model.phalanx_velocity[4], 80.0, 160.0, "a joint of a finger"}};
  for (const auto& row : rows) {
    SCOPED_TRACE(row.who);
    Pose free;
    free.position = Vector3d(2.0, 1.0, 3.0);
    plant_.place(Place::World, free);
    plant_.model().data()->qvel[row.at] = row.good;
    EXPECT_EQ(endOf(1), "");
    plant_.model().data()->qvel[row.at] = row.bad;
    EXPECT_NE(endOf(1).find(std::string(row.who) + " is faster"), std::string::npos);
    plant_.model().data()->qvel[row.at] = 0.0;
  }
}
