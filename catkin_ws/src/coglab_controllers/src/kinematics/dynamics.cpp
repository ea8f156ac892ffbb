#include "coglab_controllers/kinematics/dynamics.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>
#include <vector>

#include <kdl/chaindynparam.hpp>
#include <kdl/tree.hpp>
#include <kdl_parser/kdl_parser.hpp>

namespace coglab_controllers {
namespace {

constexpr double kTurn = 1e-4;  // rad, step of the fastest joint for the derivative of M

/// Inertia of all bodies behind a segment's end with their joints at zero, in the frame of that
/// end.
KDL::RigidBodyInertia hangingOn(const KDL::TreeElement& element,
                                const std::set<std::string>& without) {
  KDL::RigidBodyInertia sum = KDL::RigidBodyInertia::Zero();
  for (const auto& child : element.children) {
    if (without.count(child->first) != 0) continue;
    const KDL::Segment& segment = child->second.segment;
    sum = sum + segment.pose(0.0) * (segment.getInertia() + hangingOn(child->second, {}));
  }
  return sum;
}

/// The chain; each segment includes the bodies attached to it beside the chain.
KDL::Chain chainWithBranches(const std::string& urdf, const std::string& base,
                             const std::string& tip) {
  KDL::Tree tree;
  if (!kdl_parser::treeFromString(urdf, tree))
    throw std::invalid_argument("expected a URDF with one tree of links, got text of " +
                                std::to_string(urdf.size()) + " characters that does not parse");
  KDL::Chain bare;
  if (!tree.getChain(base, tip, bare))
    throw std::invalid_argument("expected a chain from link '" + base + "' to link '" + tip +
                                "' in the URDF, found none");
  if (bare.getNrOfJoints() != kMaxJoints)
    throw std::invalid_argument("expected 7 movable joints between '" + base + "' and '" + tip +
                                "', found " + std::to_string(bare.getNrOfJoints()));
  std::set<std::string> on_chain;
  for (const KDL::Segment& segment : bare.segments) on_chain.insert(segment.getName());
  KDL::Chain chain;
  for (const KDL::Segment& segment : bare.segments) {
    const KDL::TreeElement& element = tree.getSegment(segment.getName())->second;
    chain.addSegment(KDL::Segment(segment.getName(), segment.getJoint(), segment.getFrameToTip(),
                                  segment.getInertia() + hangingOn(element, on_chain)));
  }
  return chain;
}

KDL::Chain loaded(const KDL::Chain& bare, double mass, const Vector3& centre) {
  KDL::Chain chain;
  for (unsigned i = 0; i < bare.getNrOfSegments(); ++i) {
    const KDL::Segment& segment = bare.getSegment(i);
    KDL::RigidBodyInertia inertia = segment.getInertia();
    if (i + 1 == bare.getNrOfSegments())
      inertia =
          inertia + KDL::RigidBodyInertia(mass, KDL::Vector(centre.x(), centre.y(), centre.z()));
    chain.addSegment(
        KDL::Segment(segment.getName(), segment.getJoint(), segment.getFrameToTip(), inertia));
  }
  return chain;
}

void require(int code, const char* what) {
  if (code < 0)
    throw std::runtime_error(std::string("KDL refused to compute ") + what + ": code " +
                             std::to_string(code));
}

}  // namespace

struct ArmDynamics::Solvers {
  Solvers(const KDL::Chain& without_load, const KDL::Chain& with_load)
      : bare(without_load), chain(with_load), parameters(chain, KDL::Vector(0.0, 0.0, -9.81)) {}

  /// M(q)
  MassMatrix massAt(const JointVector& q) {
    joints.data = q;
    require(parameters.JntToMass(joints, mass), "the mass matrix");
    return mass.data;
  }

  KDL::Chain bare, chain;  // the solvers keep a reference to the second
  KDL::ChainDynParam parameters;
  KDL::JntArray joints{kMaxJoints}, velocity{kMaxJoints}, torque{kMaxJoints};
  KDL::JntSpaceInertiaMatrix mass{kMaxJoints};
};

ArmDynamics::ArmDynamics(const std::string& urdf, const std::string& base_link,
                         const std::string& tip_link) {
  const KDL::Chain chain = chainWithBranches(urdf, base_link, tip_link);
  solvers_ = std::make_unique<Solvers>(chain, chain);
}

ArmDynamics::~ArmDynamics() = default;
ArmDynamics::ArmDynamics(ArmDynamics&&) noexcept = default;
ArmDynamics& ArmDynamics::operator=(ArmDynamics&&) noexcept = default;

void ArmDynamics::setPayload(double mass, const Vector3& centre) {
  if (!(mass >= 0.0) || !std::isfinite(mass) || !centre.allFinite())
    throw std::invalid_argument("a payload needs a mass of 0 kg or more and a finite centre, got " +
                                std::to_string(mass) + " kg");
  const KDL::Chain bare = solvers_->bare;
  solvers_ = std::make_unique<Solvers>(bare, mass > 0.0 ? loaded(bare, mass, centre) : bare);
}

DynamicTerms ArmDynamics::evaluate(const JointVector& q, const JointVector& dq) {
  Solvers& s = *solvers_;
  DynamicTerms terms;
  terms.mass = s.massAt(q);
  terms.momentum = terms.mass * dq;
  s.joints.data = q;
  require(s.parameters.JntToGravity(s.joints, s.torque), "gravity");
  terms.gravity = s.torque.data;
  const double fastest = dq.cwiseAbs().maxCoeff();
  if (!(fastest > 0.0)) return terms;
  s.velocity.data = dq;
  require(s.parameters.JntToCoriolis(s.joints, s.velocity, s.torque), "the velocity torques");
  terms.coriolis = s.torque.data;
  // M' is the derivative of M along the motion: by central differences over a tiny turn.
  const double step = kTurn / fastest;
  const JointVector ahead = s.massAt(q + step * dq) * dq, behind = s.massAt(q - step * dq) * dq;
  terms.transposed = (ahead - behind) / (2.0 * step) - terms.coriolis;
  return terms;
}

}  // namespace coglab_controllers
