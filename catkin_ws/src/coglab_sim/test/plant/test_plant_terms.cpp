/// Mass matrix, velocity and gravity torques and Jacobian of the plant, with all its fingers, by
/// MuJoCo, against KDL's recursion over a tree that this test builds from the robot description and
/// the hand's table.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>
#include <kdl/tree.hpp>
#include <kdl/treeidsolver_recursive_newton_euler.hpp>
#include <kdl_parser/kdl_parser.hpp>

#include "coglab_sim/plant/plant.hpp"
#include "coglab_sim/random.hpp"

using namespace coglab_sim;
using namespace coglab_sim::plant;

namespace {

constexpr double kTolerance = 1e-6;

KDL::Vector kdl(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }

KDL::RigidBodyInertia phalanxInertia(const Phalanx& p) {
  const double across = p.mass * (3.0 * p.radius * p.radius + p.length * p.length) / 12.0;
  const double about = 0.5 * p.mass * p.radius * p.radius;
  const Matrix3d i =
      across * Matrix3d::Identity() + (about - across) * p.along * p.along.transpose();
  return KDL::RigidBodyInertia(
      p.mass, kdl(0.5 * p.length * p.along),
      KDL::RotationalInertia(i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2)));
}

/// Mass and first moment of a segment with the fingers of the description, in its own frame.
void addMoment(const KDL::SegmentMap::const_iterator& at, const KDL::Frame& frame, bool first,
               double& mass, KDL::Vector& moment) {
  const KDL::Segment& segment = GetTreeElementSegment(at->second);
  const KDL::RigidBodyInertia inertia = segment.getInertia();
  mass += inertia.getMass();
  moment += inertia.getMass() * (frame * inertia.getCOG());
  for (const auto& child : GetTreeElementChildren(at->second)) {
    const KDL::Segment& below = GetTreeElementSegment(child->second);
    if (first && below.getJoint().getType() == KDL::Joint::None) continue;
    addMoment(child, frame * below.pose(0.0), false, mass, moment);
  }
}

/// The palm alone: the description's hand less the phalanges of the table, which stretch from
/// their pivots with all joints at zero.
KDL::RigidBodyInertia palmInertia(const KDL::SegmentMap::const_iterator& at,
                                  const HandTable& hand) {
  double mass = 0.0;
  KDL::Vector moment;
  addMoment(at, KDL::Frame::Identity(), true, mass, moment);
  Vector3d pivot = Vector3d::Zero();
  for (const Phalanx& p : hand.phalanges) {
    pivot = p.first ? p.pivot : Vector3d(pivot + p.pivot);
    mass -= p.mass;
    moment = moment - p.mass * kdl(pivot + 0.5 * p.length * p.along);
  }
  KDL::RigidBodyInertia whole = GetTreeElementSegment(at->second).getInertia();
  const KDL::RigidBodyInertia centred = whole.RefPoint(whole.getCOG());
  return KDL::RigidBodyInertia(mass, moment / mass,
                               mass / whole.getMass() * centred.getRotationalInertia());
}

/// Copies the description's tree without its movable fingers.
void copyBelow(const KDL::SegmentMap::const_iterator& at, const HandTable& hand, KDL::Tree& to) {
  for (const auto& child : GetTreeElementChildren(at->second)) {
    KDL::Segment segment = GetTreeElementSegment(child->second);
    const bool moves = segment.getJoint().getType() != KDL::Joint::None;
    if (at->first == hand.palm && moves) continue;
    if (segment.getName() == hand.palm)
      segment = KDL::Segment(segment.getName(), segment.getJoint(), segment.getFrameToTip(),
                             palmInertia(child, hand));
    ASSERT_TRUE(to.addSegment(segment, at->first));
    copyBelow(child, hand, to);
  }
}

KDL::Tree expectedTree(const HandTable& hand) {
  KDL::Tree description;
  EXPECT_TRUE(kdl_parser::treeFromFile(URDF, description));
  KDL::Tree tree(description.getRootSegment()->first);
  copyBelow(description.getRootSegment(), hand, tree);
  std::string before = hand.palm;
  for (const Phalanx& p : hand.phalanges) {
    const KDL::Joint joint(p.name, kdl(p.pivot), kdl(p.axis), KDL::Joint::RotAxis);
    tree.addSegment(KDL::Segment(p.name, joint, KDL::Frame(kdl(p.pivot)), phalanxInertia(p)),
                    p.first ? hand.palm : before);
    before = p.name;
  }
  return tree;
}

/// The plant beside KDL's tree, with the number of each degree of freedom in both.
struct Pair {
  Pair() : tree(expectedTree(config.hand)), joints(tree.getNrOfJoints()) {
    config.urdf = URDF;
    plant = std::make_unique<Plant>(config);
    const Plant::Terms terms = plant->terms();
    const auto names = armJoints(URDF, config.hand.palm);
    for (std::size_t i = 0; i < 7; ++i) {
      ours.push_back(terms.arm[i]);
      at.push_back(plant->model().arm_position[i]);
      theirs.push_back(numberOf(names[i]));
      armature.push_back(config.drives.rotor_inertia[static_cast<Eigen::Index>(i)]);
    }
    for (std::size_t i = 0; i < config.hand.phalanges.size(); ++i) {
      ours.push_back(terms.fingers[i]);
      at.push_back(plant->model().phalanx_position[i]);
      theirs.push_back(numberOf(config.hand.phalanges[i].name));
      armature.push_back(config.hand.joint_armature);
    }
  }

  unsigned numberOf(const std::string& joint) const {
    for (const auto& [name, element] : tree.getSegments()) {
      if (element.segment.getJoint().getName() == joint) return element.q_nr;
    }
    ADD_FAILURE() << joint;
    return 0;
  }

  /// A random state in both; the speeds of the plant may be left zero.
  void draw(Random& random, KDL::JntArray& q, KDL::JntArray& v) {
    mjData* d = plant->model().data();
    for (std::size_t i = 0; i < ours.size(); ++i) {
      q(theirs[i]) = i < 7 ? 4.0 * random.uniform() - 2.0 : 1.2 * random.uniform();
      v(theirs[i]) = 4.0 * random.uniform() - 2.0;
      d->qpos[at[i]] = q(theirs[i]);
    }
  }
  Plant::Terms terms(const KDL::JntArray& v) {
    mjData* d = plant->model().data();
    for (std::size_t i = 0; i < ours.size(); ++i) d->qvel[ours[i]] = v(theirs[i]);
    mj_step1(plant->model().get(), d);
    return plant->terms();
  }

  PlantConfig config;
  KDL::Tree tree;
  unsigned joints;
  std::unique_ptr<Plant> plant;
  std::vector<int> ours, at;
  std::vector<unsigned> theirs;
  std::vector<double> armature;
};

}  // namespace

TEST(PlantTerms, TorquesAndMassesEqualThoseOfKdlWithAllFingers) {
  Pair pair;
  ASSERT_EQ(pair.joints, 7 + pair.config.hand.phalanges.size());
  KDL::TreeIdSolver_RNE inverse(pair.tree, KDL::Vector(0.0, 0.0, -9.81));
  Random random(7);
  const KDL::WrenchMap none;
  double mass = 0.0, bias = 0.0, gravity = 0.0;
  for (int trial = 0; trial < 100; ++trial) {
    KDL::JntArray q(pair.joints), v(pair.joints), still(pair.joints), unit(pair.joints),
        moving(pair.joints), resting(pair.joints), torque(pair.joints);
    pair.draw(random, q, v);
    ASSERT_EQ(inverse.CartToJnt(q, still, still, none, resting), 0);
    ASSERT_EQ(inverse.CartToJnt(q, v, still, none, moving), 0);
    const Plant::Terms at_speed = pair.terms(v), at_rest = pair.terms(still);
    for (std::size_t column = 0; column < pair.ours.size(); ++column) {
      KDL::SetToZero(unit);
      unit(pair.theirs[column]) = 1.0;
      ASSERT_EQ(inverse.CartToJnt(q, still, unit, none, torque), 0);
      for (std::size_t i = 0; i < pair.ours.size(); ++i) {
        const unsigned k = pair.theirs[i];
        const double expected = torque(k) - resting(k) + (i == column ? pair.armature[i] : 0.0);
        mass = std::max(mass, std::abs(at_rest.mass(pair.ours[i], pair.ours[column]) - expected));
      }
      const unsigned k = pair.theirs[column];
      bias = std::max(bias, std::abs(at_speed.bias[pair.ours[column]] - moving(k)));
      gravity = std::max(gravity, std::abs(at_rest.bias[pair.ours[column]] - resting(k)));
    }
  }
  std::printf("largest difference to KDL: M %.1e  C+g %.1e  g %.1e\n", mass, bias, gravity);
  EXPECT_LT(mass, kTolerance);
  EXPECT_LT(bias, kTolerance);
  EXPECT_LT(gravity, kTolerance);
}

TEST(PlantTerms, TheJacobianEqualsThatOfKdl) {
  Pair pair;
  KDL::Chain chain;
  ASSERT_TRUE(pair.tree.getChain("world", "ih2_palm", chain));
  KDL::ChainJntToJacSolver solver(chain);
  Random random(8);
  double worst = 0.0;
  for (int trial = 0; trial < 100; ++trial) {
    KDL::JntArray q(pair.joints), v(pair.joints), arm(7);
    pair.draw(random, q, v);
    const Plant::Terms terms = pair.terms(v);
    for (unsigned i = 0; i < 7; ++i) arm(i) = q(pair.theirs[i]);
    KDL::Jacobian jacobian(7);
    ASSERT_EQ(solver.JntToJac(arm, jacobian), 0);
    for (int i = 0; i < 7; ++i) {
      const Vector6 difference =
          jacobian.data.col(i) - terms.jacobian.col(pair.ours[static_cast<std::size_t>(i)]);
      worst = std::max(worst, difference.cwiseAbs().maxCoeff());
    }
  }
  std::printf("largest difference to KDL: J %.1e\n", worst);
  EXPECT_LT(worst, kTolerance);
}
