/// The model that MuJoCo compiles of the cell, number by number: who meets whom, shapes and places,
/// joints, tendons and their actuators; and how deep solids stand in each other.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <set>
#include <string>

#include "coglab_sim/plant/plant.hpp"
#include "overlap.hpp"

using namespace coglab_sim;
using namespace coglab_sim::plant;

namespace {

SceneDescription scene() {
  SceneDescription scene;
  scene.urdf = URDF;
  scene.rotor_inertia << 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0;
  return scene;
}

int bodyOf(const mjModel* m, const std::string& name) {
  return mj_name2id(m, mjOBJ_BODY, name.c_str());
}

/// Whether two geoms may meet, as MuJoCo decides it.
bool meet(const mjModel* m, int one, int two) {
  return (m->geom_contype[one] & m->geom_conaffinity[two]) != 0 ||
         (m->geom_contype[two] & m->geom_conaffinity[one]) != 0;
}

Vector3d three(const mjtNum* values) { return {values[0], values[1], values[2]}; }

/// The first geom of a body.
int geomOf(const mjModel* m, const std::string& body) { return m->body_geomadr[bodyOf(m, body)]; }

}  // namespace

TEST(PlantModel, WhoMeetsWhom) {
  const Model model(scene());
  const mjModel* m = model.get();
  const int grasped = geomOf(m, "object"), solid = grasped + 1;
  const int arm = geomOf(m, "lwr_link_3"), palm = geomOf(m, "ih2_base_link");
  const int finger = geomOf(m, "index_distal"), person = geomOf(m, "person_hand");
  struct Pair {
    int one, two;
    bool meets;
  };
  for (const auto& [one, two, meets] : {Pair{arm, arm, true},
                                        {arm, palm, true},
                                        {arm, finger, true},
                                        {arm, grasped, true},
                                        {arm, model.board, true},
                                        {arm, model.floor, true},
                                        {arm, person, true},
                                        {arm, solid, false},
                                        {finger, finger, false},
                                        {finger, palm, false},
                                        {finger, grasped, true},
                                        {finger, person, true},
                                        {finger, model.board, true},
                                        {palm, grasped, true},
                                        {palm, model.floor, true},
                                        {palm, person, true},
                                        {grasped, person, false},
                                        {solid, person, false},
                                        {grasped, model.board, false},
                                        {solid, model.board, true},
                                        {solid, model.floor, true},
                                        {solid, finger, false},
                                        {person, model.board, false},
                                        {person, model.floor, false},
                                        {model.board, model.floor, false}})
    EXPECT_EQ(meet(m, one, two), meets) << one << " " << two;
  for (const auto& [geom, dimensions] : {std::pair{arm, 3},
                                         {palm, 4},
                                         {finger, 4},
                                         {grasped, 4},
                                         {solid, 4},
                                         {person, 3},
                                         {model.board, 4},
                                         {model.floor, 4}})
    EXPECT_EQ(m->geom_condim[geom], dimensions) << geom;
}

TEST(PlantModel, NeighboursOfTheArmDoNotMeetAndFingersPassTheWrist) {
  const Model model(scene());
  const mjModel* m = model.get();
  std::set<std::pair<std::string, std::string>> excluded;
  for (int i = 0; i < m->nexclude; ++i) {
    // MuJoCo counts the bodies of a signature from 1.
    const int one = (m->exclude_signature[i] >> 16) - 1,
              two = (m->exclude_signature[i] & 0xFFFF) - 1;
    std::pair<std::string, std::string> names{mj_id2name(m, mjOBJ_BODY, one),
                                              mj_id2name(m, mjOBJ_BODY, two)};
    if (names.second < names.first) std::swap(names.first, names.second);
    excluded.insert(names);
  }
  const auto apart = [&](std::string one, std::string two) {
    if (two < one) std::swap(one, two);
    return excluded.count({one, two}) == 0;
  };
  const std::array<std::string, 9> chain = {"lwr_base_link", "lwr_link_1", "lwr_link_2",
                                            "lwr_link_3",    "lwr_link_4", "lwr_link_5",
                                            "lwr_link_6",    "lwr_link_7", "ih2_base_link"};
  for (const std::string& link : chain) ASSERT_GE(bodyOf(m, link), 0) << link;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    for (std::size_t j = i + 1; j < chain.size(); ++j) {
      // The palm is fixed to the last link: it is as near to the others as that is.
      const std::size_t joints = (j == 8 ? 7 : j) - i;
      EXPECT_EQ(apart(chain[i], chain[j]), joints > 2) << chain[i] << " " << chain[j];
    }
  }
  for (const Phalanx& phalanx : scene().hand.phalanges) {
    EXPECT_FALSE(apart("lwr_link_7", phalanx.name));
    EXPECT_FALSE(apart("lwr_link_6", phalanx.name));
    EXPECT_TRUE(apart("lwr_link_5", phalanx.name));
  }
}

TEST(PlantModel, BoardFloorAndPersonStandWhereTheySay) {
  SceneDescription where = scene();
  where.surroundings.board_center = Vector3d(0.4, -0.6, 0.1);
  where.surroundings.board_size = Vector3d(0.6, 0.5, 0.0);
  where.surroundings.floor_height = -0.9;
  const Model model(where);
  const mjModel* m = model.get();
  EXPECT_EQ(m->geom_type[model.board], mjGEOM_BOX);
  EXPECT_LT((three(m->geom_size + 3 * model.board) - Vector3d(0.3, 0.25, 0.02)).norm(), 1e-12);
  EXPECT_LT((three(m->geom_pos + 3 * model.board) - Vector3d(0.4, -0.6, 0.08)).norm(), 1e-12);
  EXPECT_EQ(m->geom_type[model.floor], mjGEOM_PLANE);
  EXPECT_EQ(m->geom_pos[3 * model.floor + 2], -0.9);
  EXPECT_EQ(m->body_mass[model.person], 0.5);
  for (const Vector3d& none : {Vector3d(0.0, 0.5, 0.0), Vector3d(0.5, 0.0, 0.0)}) {
    where.surroundings.board_size = none;
    EXPECT_EQ(Model(where).board, -1);
  }
  where.surroundings.board_size = Vector3d(0.01, 0.01, 0.0);
  EXPECT_GE(Model(where).board, 0);
}

TEST(PlantModel, TheObjectIsRoundForHandsAndItselfForPlanes) {
  SceneDescription with = scene();
  with.object.mass = 0.7;
  with.object.size = Vector3d(0.06, 0.08, 0.2);
  with.object.center = Vector3d(0.01, 0.02, 0.1);
  with.object.friction = 0.45;
  struct Shape {
    const char* name;
    int hands, planes;
    Vector3d size;
  };
  for (const Shape& shape :
       {Shape{"cylinder", mjGEOM_CAPSULE, mjGEOM_CYLINDER, Vector3d(0.03, 0.1, 0.0)},
        Shape{"sphere", mjGEOM_SPHERE, mjGEOM_SPHERE, Vector3d(0.03, 0.0, 0.0)},
        Shape{"box", mjGEOM_BOX, mjGEOM_BOX, Vector3d(0.03, 0.04, 0.1)}}) {
    SCOPED_TRACE(shape.name);
    with.object.shape = shape.name;
    const Model model(with);
    const mjModel* m = model.get();
    const int first = geomOf(m, "object");
    EXPECT_EQ(m->geom_type[first], shape.hands);
    EXPECT_EQ(m->geom_type[first + 1], shape.planes);
    EXPECT_EQ(m->body_mass[model.object], 0.7);
    EXPECT_LT((three(m->body_ipos + 3 * model.object) - with.object.center).norm(), 1e-12);
    EXPECT_LT((three(m->body_inertia + 3 * model.object) - inertiaOf(with.object)).norm(), 1e-12);
    for (const int geom : {first, first + 1}) {
      for (int i = 0; i < (shape.size.z() > 0.0 ? 3 : shape.size.y() > 0.0 ? 2 : 1); ++i)
        EXPECT_NEAR(m->geom_size[3 * geom + i], shape.size[i], 1e-12);
      EXPECT_LT((three(m->geom_pos + 3 * geom) - with.object.center).norm(), 1e-12);
      EXPECT_LT((three(m->geom_friction + 3 * geom) - Vector3d(0.45, 0.004, 0.0001)).norm(), 1e-12);
      EXPECT_EQ(m->geom_priority[geom], 1);
    }
  }
}

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

TEST(Overlaps, SolidsWhoseMiddlesCoincideStandInEachOtherAsDeepAsTheSmallerIsThick) {
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
