/// Mass matrix, velocity and gravity torques and Jacobian of the plant, with all its fingers, by
/// MuJoCo, against KDL's recursion over a tree that this test builds from the robot description and
/// the hand's table.
#include <gtest/gtest.h>

#include <array>

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

/// Copies the description's tree without its movable fingers, the palm lightened by the phalanges.
void copyBelow(const KDL::Tree& from, const KDL::SegmentMap::const_iterator& at,
               const HandTable& hand, KDL::Tree& to) {
  for (const auto& child : GetTreeElementChildren(at->second)) {
    KDL::Segment segment = GetTreeElementSegment(child->second);
    const bool finger = at->first == hand.palm &&
                        segment.getJoint().getType() != KDL::Joint::None;
    if (finger) continue;
    if (segment.getName() == hand.palm) {
      const KDL::RigidBodyInertia whole = segment.getInertia();
      segment = KDL::Segment(segment.getName(), segment.getJoint(), segment.getFrameToTip(),
                             (1.0 - hand.phalangesMass() / whole.getMass()) * whole);
    }
    ASSERT_TRUE(to.addSegment(segment, at->first));
    copyBelow(from, child, hand, to);
  }
}

KDL::Tree expectedTree(const HandTable& hand) {
  KDL::Tree description;
  EXPECT_TRUE(kdl_parser::treeFromFile(URDF, description));
  KDL::Tree tree(description.getRootSegment()->first);
  copyBelow(description, description.getRootSegment(), hand, tree);
  std::string before = hand.palm;
  for (const Phalanx& p : hand.phalanges) {
    const KDL::Joint joint(p.name, kdl(p.pivot), kdl(p.axis), KDL::Joint::RotAxis);
    tree.addSegment(KDL::Segment(p.name, joint, KDL::Frame(kdl(p.pivot)), phalanxInertia(p)),
                    p.first ? hand.palm : before);
    before = p.name;
  }
  return tree;
}

}  // namespace

TEST(PlantTerms, EqualThoseOfKdlWithAllFingers) {
  PlantConfig config;
  config.urdf = URDF;
  Plant plant(config);
  const HandTable& hand = config.hand;
  const KDL::Tree tree = expectedTree(hand);
  const int joints = static_cast<int>(tree.getNrOfJoints());
  ASSERT_EQ(joints, 7 + static_cast<int>(hand.phalanges.size()));
  KDL::TreeIdSolver_RNE inverse(tree, KDL::Vector(0.0, 0.0, -9.81));
  KDL::Chain chain;
  ASSERT_TRUE(tree.getChain("world", "ih2_palm", chain));

  // Where KDL keeps each degree of freedom of the plant.
  std::vector<int> ours, theirs;
  const auto names = armJoints(URDF, hand.palm);
  const auto numberOf = [&](const std::string& joint) {
    for (const auto& [name, element] : tree.getSegments()) {
      if (element.segment.getJoint().getName() == joint) return static_cast<int>(element.q_nr);
    }
    ADD_FAILURE() << joint;
    return 0;
  };
  Plant::Terms terms = plant.terms();
  for (std::size_t i = 0; i < 7; ++i) {
    ours.push_back(terms.arm[i]);
    theirs.push_back(numberOf(names[i]));
  }
  for (std::size_t i = 0; i < hand.phalanges.size(); ++i) {
    ours.push_back(terms.fingers[i]);
    theirs.push_back(numberOf(hand.phalanges[i].name));
  }

  Random random(7);
  double worst_mass = 0.0, worst_bias = 0.0, worst_gravity = 0.0, worst_jacobian = 0.0;
  for (int trial = 0; trial < 100; ++trial) {
    KDL::JntArray q(joints), v(joints), a(joints), torque(joints), at_rest(joints), still(joints);
    mjData* d = plant.model().data();
    for (std::size_t i = 0; i < ours.size(); ++i) {
      const double position = i < 7 ? 4.0 * random.uniform() - 2.0 : 1.2 * random.uniform();
      const double speed = 4.0 * random.uniform() - 2.0;
      d->qpos[i < 7 ? plant.model().arm_position[i] : plant.model().phalanx_position[i - 7]] =
          q(static_cast<unsigned>(theirs[i])) = position;
      d->qvel[ours[i]] = v(static_cast<unsigned>(theirs[i])) = speed;
    }
    mj_step1(plant.model().get(), d);
    terms = plant.terms();
    const KDL::WrenchMap none;
    ASSERT_EQ(inverse.CartToJnt(q, still, still, none, at_rest), 0);
    ASSERT_EQ(inverse.CartToJnt(q, v, still, none, torque), 0);
    for (std::size_t i = 0; i < ours.size(); ++i) {
      const double theirs_bias = torque(static_cast<unsigned>(theirs[i]));
      worst_bias = std::max(worst_bias, std::abs(terms.bias[ours[i]] - theirs_bias));
    }
    for (std::size_t column = 0; column < ours.size(); ++column) {
      KDL::SetToZero(a);
      a(static_cast<unsigned>(theirs[column])) = 1.0;
      ASSERT_EQ(inverse.CartToJnt(q, still, a, none, torque), 0);
      for (std::size_t i = 0; i < ours.size(); ++i) {
        const auto k = static_cast<unsigned>(theirs[i]);
        double expected = torque(k) - at_rest(k);
        if (i == column)
          expected += i < 7 ? config.drives.rotor_inertia[static_cast<Eigen::Index>(i)]
                            : hand.joint_armature;
        worst_mass = std::max(worst_mass, std::abs(terms.mass(ours[i], ours[column]) - expected));
      }
    }
    KDL::JntArray arm(7);
    for (unsigned i = 0; i < 7; ++i) arm(i) = q(static_cast<unsigned>(theirs[i]));
    KDL::Jacobian jacobian(7);
    KDL::ChainJntToJacSolver(chain).JntToJac(arm, jacobian);
    for (int i = 0; i < 7; ++i) {
      const Vector6 difference =
          jacobian.data.col(i) - terms.jacobian.col(ours[static_cast<std::size_t>(i)]);
      worst_jacobian = std::max(worst_jacobian, difference.cwiseAbs().maxCoeff());
    }
    for (const int dof : ours) d->qvel[dof] = 0.0;
    mj_step1(plant.model().get(), d);
    terms = plant.terms();
    for (std::size_t i = 0; i < ours.size(); ++i)
      worst_gravity = std::max(worst_gravity, std::abs(terms.bias[ours[i]] -
                                                       at_rest(static_cast<unsigned>(theirs[i]))));
  }
  std::printf("largest difference to KDL: M %.1e  C+g %.1e  g %.1e  J %.1e\n", worst_mass,
              worst_bias, worst_gravity, worst_jacobian);
  EXPECT_LT(worst_mass, kTolerance);
  EXPECT_LT(worst_bias, kTolerance);
  EXPECT_LT(worst_gravity, kTolerance);
  EXPECT_LT(worst_jacobian, kTolerance);
}
