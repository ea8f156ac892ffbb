#include "coglab_sim/arm_model.hpp"

#include <algorithm>
#include <set>
#include <stdexcept>

#include <urdf_parser/urdf_parser.h>
#include <kdl/tree.hpp>
#include <kdl_parser/kdl_parser.hpp>

namespace coglab_sim {
namespace {

constexpr int kJoints = 7;

/// Inertia of a side branch in its parent's frame, with all its joints at zero.
KDL::RigidBodyInertia branchInertia(const KDL::TreeElement& element) {
  KDL::RigidBodyInertia inertia = element.segment.getInertia();
  for (const auto& child : element.children) inertia = inertia + branchInertia(child->second);
  return element.segment.pose(0.0) * inertia;
}

/// Scales the inertia about the centre of mass; the mass stays.
KDL::RigidBodyInertia scaled(const KDL::RigidBodyInertia& inertia, double share) {
  if (inertia.getMass() <= 0.0) return inertia;
  KDL::RigidBodyInertia about_origin = inertia;
  const KDL::RigidBodyInertia centred = about_origin.RefPoint(inertia.getCOG());
  return KDL::RigidBodyInertia(inertia.getMass(), inertia.getCOG(),
                               share * centred.getRotationalInertia());
}

/// Returns the chain with side branches added to their parents, and with bodies behind fixed joints
/// merged into the moving ones.
KDL::Chain condensed(const KDL::Tree& tree, const KDL::Chain& chain, const ModelErrors& errors) {
  std::set<std::string> on_chain;
  for (const auto& segment : chain.segments) on_chain.insert(segment.getName());

  std::vector<KDL::Segment> bodies;
  std::size_t moving = 0;
  for (const auto& segment : chain.segments) {
    KDL::RigidBodyInertia inertia = segment.getInertia();
    for (const auto& child : tree.getSegment(segment.getName())->second.children) {
      if (on_chain.count(child->first) == 0) inertia = inertia + branchInertia(child->second);
    }
    const bool fixed = segment.getJoint().getType() == KDL::Joint::None;
    if (!fixed) inertia = scaled(inertia, errors.inertia[std::min<std::size_t>(moving++, 6)]);
    if (fixed && moving == static_cast<std::size_t>(kJoints)) inertia = errors.payload * inertia;
    if (fixed && !bodies.empty()) {
      const KDL::Segment& carrier = bodies.back();
      const KDL::Frame step = segment.getFrameToTip();
      bodies.back() =
          KDL::Segment(segment.getName(), carrier.getJoint(), carrier.getFrameToTip() * step,
                       step.Inverse() * carrier.getInertia() + inertia);
    } else {
      bodies.emplace_back(segment.getName(), segment.getJoint(), segment.getFrameToTip(), inertia);
    }
  }
  KDL::Chain result;
  for (const auto& body : bodies) result.addSegment(body);
  return result;
}

KDL::Chain readChain(const std::string& urdf, const ModelErrors& errors, const std::string& base,
                     const std::string& tip) {
  // Not treeFromFile(): it does not check that the file has a robot.
  const auto robot = urdf::parseURDFFile(urdf);
  KDL::Tree tree;
  if (!robot || !kdl_parser::treeFromUrdfModel(*robot, tree)) {
    throw std::runtime_error("robot description " + urdf + " cannot be read as a URDF");
  }
  KDL::Chain chain;
  if (!tree.getChain(base, tip, chain)) {
    throw std::runtime_error("robot description " + urdf + " has no chain from " + base + " to " +
                             tip);
  }
  if (chain.getNrOfJoints() != kJoints) {
    throw std::runtime_error("robot description " + urdf + ": expected 7 joints from " + base +
                             " to " + tip + ", found " + std::to_string(chain.getNrOfJoints()));
  }
  return condensed(tree, chain, errors);
}

}  // namespace

ArmModel::ArmModel(const std::string& urdf, const ModelErrors& errors, const std::string& base,
                   const std::string& tip)
    : chain_(readChain(urdf, errors, base, tip)),
      dynamics_(chain_, KDL::Vector(0.0, 0.0, -9.81)),
      forward_(chain_),
      jacobian_solver_(chain_),
      q_(kJoints),
      dq_(kJoints),
      coriolis_(kJoints),
      gravity_(kJoints),
      mass_(kJoints),
      jacobian_(kJoints) {}

void ArmModel::evaluate(const Vector7& position, const Vector7& velocity, ArmTerms& terms) {
  evaluateDynamics(position, velocity, terms);
  evaluateKinematics(position, terms);
}

void ArmModel::evaluateDynamics(const Vector7& position, const Vector7& velocity, ArmTerms& terms) {
  q_.data = position;
  dq_.data = velocity;
  dynamics_.JntToMass(q_, mass_);
  dynamics_.JntToCoriolis(q_, dq_, coriolis_);
  dynamics_.JntToGravity(q_, gravity_);
  terms.mass = mass_.data;
  terms.coriolis = coriolis_.data;
  terms.gravity = gravity_.data;
}

void ArmModel::evaluateKinematics(const Vector7& position, ArmTerms& terms) {
  q_.data = position;
  jacobian_solver_.JntToJac(q_, jacobian_);
  KDL::Frame tip;
  forward_.JntToCart(q_, tip);
  terms.jacobian = jacobian_.data;
  terms.tip.position = Vector3d(tip.p.x(), tip.p.y(), tip.p.z());
  Matrix3d rotation;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rotation(row, column) = tip.M(row, column);
  }
  terms.tip.rotation = Quaterniond(rotation);
}

}  // namespace coglab_sim
