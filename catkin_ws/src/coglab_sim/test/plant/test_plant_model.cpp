/// Objects: distances from their surface, inertias, and depths of overlaps.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <string>

#include "coglab_sim/plant/plant.hpp"
#include "overlap.hpp"

using namespace coglab_sim;
using namespace coglab_sim::plant;

TEST(Objects, DistancesFromTheirSurface) {
  Object object;
  object.size = Vector3d(0.2, 0.4, 0.6);
  object.center = Vector3d(1.0, 0.0, 0.3);
  const auto from = [&](const Vector3d& p) { return distanceFrom(object, object.center + p); };
  object.shape = "box";
  EXPECT_NEAR(from({0.15, 0.0, 0.0}), 0.05, 1e-12);
  EXPECT_NEAR(from({-0.13, 0.24, 0.0}), 0.05, 1e-12);
  EXPECT_NEAR(from({0.0, 0.0, -0.4}), 0.1, 1e-12);
  EXPECT_NEAR(from({0.0, 0.0, 0.0}), -0.1, 1e-12);
  EXPECT_NEAR(from({0.0, 0.19, 0.0}), -0.01, 1e-12);
  object.shape = "cylinder";
  EXPECT_NEAR(from({0.09, 0.12, 0.0}), 0.05, 1e-12);
  EXPECT_NEAR(from({0.0, 0.0, 0.35}), 0.05, 1e-12);
  EXPECT_NEAR(from({0.13, 0.0, -0.34}), 0.05, 1e-12);
  EXPECT_NEAR(from({0.0, 0.0, 0.0}), -0.1, 1e-12);
  EXPECT_NEAR(from({0.0, 0.05, 0.29}), -0.01, 1e-12);
  object.shape = "sphere";
  EXPECT_NEAR(from({0.0, 0.3, 0.4}), 0.4, 1e-12);
  EXPECT_NEAR(from({0.0, 0.0, 0.0}), -0.1, 1e-12);
}

TEST(Objects, InertiasOfSolids) {
  Object object;
  object.mass = 3.0;
  object.size = Vector3d(0.2, 0.3, 0.4);
  object.shape = "box";
  EXPECT_LT((inertiaOf(object) - Vector3d(0.0625, 0.05, 0.0325)).norm(), 1e-12);
  object.shape = "cylinder";
  EXPECT_LT((inertiaOf(object) - Vector3d(0.0475, 0.0475, 0.015)).norm(), 1e-12);
  object.shape = "sphere";
  EXPECT_LT((inertiaOf(object) - Vector3d::Constant(0.012)).norm(), 1e-12);
}

namespace {

/// Two solids of a model of their own; the second one at a place.
double depthOf(const std::string& one, const std::string& two, const std::string& place) {
  const std::string text = "<mujoco><compiler angle=\"radian\"/><worldbody><geom " + one +
                           "/><body " + place + "><freejoint/><geom " + two +
                           "/></body></worldbody></mujoco>";
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  EXPECT_EQ(mj_makeEmptyFileVFS(files.get(), "two.xml", static_cast<int>(text.size())), 0);
  std::memcpy(files->filedata[0], text.data(), text.size());
  std::array<char, 500> error{};
  mjModel* m = mj_loadXML("two.xml", files.get(), error.data(), 500);
  mj_deleteVFS(files.get());
  EXPECT_NE(m, nullptr) << error.data();
  mjData* d = mj_makeData(m);
  mj_step1(m, d);
  d->ncon = 0;  // what contacts miss
  const Overlap found = deepestOverlap(m, d, [](int, int) { return true; });
  const Overlap none = deepestOverlap(m, d, [](int, int) { return false; });
  EXPECT_EQ(none.depth, 0.0);
  EXPECT_EQ(none.one, -1);
  EXPECT_EQ(none.two, -1);
  if (found.depth > 0.0) {
    EXPECT_EQ(found.one, 0);
    EXPECT_EQ(found.two, 1);
  }
  mj_deleteData(d);
  mj_deleteModel(m);
  return found.depth;
}

}  // namespace

TEST(Overlaps, CoincidentSolidsOverlapByTheThicknessOfTheSmallerOne) {
  const std::string sphere = "type=\"sphere\" size=\"0.1\"",
                    box = "type=\"box\" size=\"0.1 0.2 0.3\"",
                    capsule = "type=\"capsule\" size=\"0.1 0.2\"",
                    cylinder = "type=\"cylinder\" size=\"0.1 0.2\"";
  for (const std::string& other : {sphere, box, capsule, cylinder})
    for (const std::string& inner : {sphere, box, capsule, cylinder})
      EXPECT_NEAR(depthOf(other, inner, "pos=\"0 0 0\""), 0.2, 1e-9) << other << inner;
}

TEST(Overlaps, OneSolidBesideAnother) {
  const std::string big = "type=\"box\" size=\"0.2 0.2 0.2\"",
                    ball = "type=\"sphere\" size=\"0.1\"",
                    rod = "type=\"capsule\" size=\"0.1 0.2\"",
                    can = "type=\"cylinder\" size=\"0.1 0.2\"",
                    floor = "type=\"plane\" size=\"0 0 1\"";
  EXPECT_NEAR(depthOf(big, ball, "pos=\"0.25 0 0\""), 0.05, 1e-9);
  EXPECT_EQ(depthOf(big, ball, "pos=\"0.31 0 0\""), 0.0);
  EXPECT_NEAR(depthOf(big, ball, "pos=\"0 -0.15 0\""), 0.15, 1e-9);
  EXPECT_NEAR(depthOf(big, rod, "pos=\"0 0 0.45\""), 0.05, 1e-9);
  EXPECT_NEAR(depthOf(big, rod, "pos=\"0 0 0.45\" euler=\"0 1.5707963 0\""), 0.0, 1e-6);
  EXPECT_NEAR(depthOf(big, rod, "pos=\"0.45 0 0\" euler=\"0 1.5707963 0\""), 0.05, 1e-6);
  EXPECT_NEAR(depthOf(big, can, "pos=\"0.25 0 0\""), 0.05, 1e-9);
  EXPECT_NEAR(depthOf(floor, ball, "pos=\"0 0 0.06\""), 0.04, 1e-9);
  EXPECT_EQ(depthOf(floor, ball, "pos=\"0 0 0.11\""), 0.0);
  EXPECT_NEAR(depthOf(floor, big, "pos=\"0 0 0.15\""), 0.05, 1e-9);
  EXPECT_NEAR(depthOf(can, ball, "pos=\"0 0 0.25\""), 0.05, 1e-9);
}
