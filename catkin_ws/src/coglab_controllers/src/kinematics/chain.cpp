#include "coglab_controllers/kinematics/chain.hpp"

#include <stdexcept>

#include <kdl/chain.hpp>
#include <kdl/tree.hpp>
#include <kdl_parser/kdl_parser.hpp>

#include "coglab_controllers/kinematics/rotation.hpp"

namespace coglab_controllers {
namespace {

Matrix3 toEigen(const KDL::Rotation& rotation) {
  Matrix3 result;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) result(row, column) = rotation(row, column);
  }
  return result;
}

Vector3 toEigen(const KDL::Vector& vector) { return Vector3(vector.x(), vector.y(), vector.z()); }

// A rotation that turns z to the given unit axis, so that every joint turns about its own z.
Matrix3 zTo(const Vector3& axis) { return shortestTurn(Vector3::UnitZ(), axis).toRotationMatrix(); }

}  // namespace

Chain::Chain(const std::string& urdf, const std::string& base_link, const std::string& tip_link)
    : base_link_(base_link) {
  KDL::Tree tree;
  if (!kdl_parser::treeFromString(urdf, tree)) {
    throw std::invalid_argument("expected a URDF with one tree of links, got text of " +
                                std::to_string(urdf.size()) +
                                " characters that does not parse; see the messages above");
  }
  auto chain = std::make_shared<KDL::Chain>();
  if (!tree.getChain(base_link, tip_link, *chain)) {
    throw std::invalid_argument("expected a chain from link '" + base_link + "' to link '" +
                                tip_link + "' in the URDF, found none; check both names");
  }
  const unsigned count = chain->getNrOfJoints();
  if (count != 6 && count != 7) {
    throw std::invalid_argument("expected 6 or 7 movable joints between '" + base_link + "' and '" +
                                tip_link + "', found " + std::to_string(count));
  }
  Matrix3 rotation = Matrix3::Identity();
  Vector3 translation = Vector3::Zero();
  for (const KDL::Segment& segment : chain->segments) {
    const KDL::Joint& joint = segment.getJoint();
    const KDL::Frame zero = segment.pose(0.0);
    if (joint.getType() == KDL::Joint::None) {
      translation += rotation * toEigen(zero.p);
      rotation = rotation * toEigen(zero.M);
      continue;
    }
    if (joint.getType() != KDL::Joint::RotAxis && joint.getType() != KDL::Joint::RotX &&
        joint.getType() != KDL::Joint::RotY && joint.getType() != KDL::Joint::RotZ) {
      throw std::invalid_argument("expected revolute or continuous joints, joint '" +
                                  joint.getName() + "' is " + joint.getTypeName());
    }
    const Vector3 origin = toEigen(joint.JointOrigin());
    const Matrix3 to_axis = zTo(toEigen(joint.JointAxis()).normalized());
    links_[joints_] = {rotation * to_axis, translation + rotation * origin};
    // The rotation behind the joint at angle zero, in the frame whose z is the joint's axis.
    rotation = to_axis.transpose() * toEigen(zero.M);
    translation = to_axis.transpose() * (toEigen(zero.p) - origin);
    joint_names_.push_back(joint.getName());
    ++joints_;
  }
  tool_ = {rotation, translation};
  kdl_ = chain;
  // With every joint at zero the arm of this project is stretched; for any other arm the sum of the
  // link lengths bounds it.
  for (int i = 2; i <= wristJoint(); ++i) reach_ += links_[i].translation.norm();
}

void Chain::evaluate(const JointVector& q, ChainState& state) const noexcept {
  Matrix3 rotation = links_[0].rotation;
  Vector3 position = links_[0].translation;
  for (int i = 0; i < joints_; ++i) {
    if (i > 0) {
      position += rotation * links_[i].translation;
      rotation = (rotation * links_[i].rotation).eval();
    }
    state.axes.col(i) = rotation.col(2);
    state.origins.col(i) = position;
    const double c = std::cos(q[i]), s = std::sin(q[i]);
    const Vector3 x = rotation.col(0);
    rotation.col(0) = c * x + s * rotation.col(1);
    rotation.col(1) = c * rotation.col(1) - s * x;
  }
  position += rotation * tool_.translation;
  state.tool.position = position;
  state.tool.orientation = Quaternion((rotation * tool_.rotation).eval());
  for (int i = 0; i < joints_; ++i) {
    const Vector3 axis = state.axes.col(i);
    state.jacobian.col(i).head<3>() = axis.cross(position - state.origins.col(i));
    state.jacobian.col(i).tail<3>() = axis;
  }
  for (int i = joints_; i < kMaxJoints; ++i) {
    state.axes.col(i).setZero();
    state.origins.col(i).setZero();
    state.jacobian.col(i).setZero();
  }
}

void Chain::evaluate(const JointVector& q, const JointVector& velocity, double dt,
                     ChainState& state) const noexcept {
  evaluate(q, state);
  if (!(dt > 0.0) || velocity.isZero(0.0)) return;
  const Pose now = state.tool;
  evaluate(q + 0.5 * dt * velocity, state);
  state.tool = now;
}

Vector3 Chain::originVelocity(const ChainState& state, int index,
                              const JointVector& velocity) noexcept {
  Vector3 result = Vector3::Zero();
  for (int i = 0; i < index; ++i) {
    result +=
        velocity[i] * state.axes.col(i).cross(state.origins.col(index) - state.origins.col(i));
  }
  return result;
}

}  // namespace coglab_controllers
