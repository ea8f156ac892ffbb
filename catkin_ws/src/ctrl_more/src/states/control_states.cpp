#include "ctrl_more/states/control_states.hpp"

#include <cmath>
#include <cstring>
#include <stdexcept>

#include <Eigen/Geometry>

#include "ctrl_more/log/words.hpp"
#include "ctrl_more/states/so3.hpp"

namespace ctrl_more {
namespace {

constexpr double kRotationTolerance = 1e-3;

}  // namespace

ControlStates::ControlStates(int joints, double period_s, Logger* logger)
    : table_("ControlStates", logger), joints_(joints), period_s_(period_s) {
  using C = ControlContainer;
  const auto add = [this](C container, const char* key, int size, const char* unit) {
    table_.declare(groupOf(container), key, size, unit, "world", false);
  };
  add(C::CentreOfMass, "com", 3, "m");
  add(C::CentreOfMass, "comVelocity", 3, "m/s");
  add(C::CentreOfMass, "comAcceleration", 3, "m/s^2");
  add(C::LinearMomentum, "linearMomentum", 3, "kg m/s");
  add(C::AngularMomentum, "angularMomentum", 3, "kg m^2/s");
  add(C::Zmp, "zmp", 3, "m");
  add(C::PelvisOrientation, "pelvis", 4, "1");
}

// Checks that a jointSpaceReference has a known type and one number per joint.
Status ControlStates::checkJoints(ControlContainer container, const std::string& key, int size,
                                  const char* who) const {
  if (container != ControlContainer::JointSpaceReference) return {};
  const std::string what = std::string(who) + ": " + nameOf(container) + "/" + key;
  if (key != "Position" && key != "Velocity" && key != "Torque") {
    return table_.refuse(what + " is no type of jointSpaceReference" +
                         suggestion(key, {"Position", "Velocity", "Torque"}));
  }
  if (joints_ != 0 && size != joints_) {
    return table_.refuse(what + " expects " + std::to_string(joints_) + " numbers, got " +
                         std::to_string(size) + "; the old value stays");
  }
  return {};
}

Status ControlStates::declare(ControlContainer container, const std::string& key, int size,
                              const std::string& unit, const std::string& frame) {
  Status status = checkJoints(container, key, size, "declare");
  if (status) status = table_.declare(groupOf(container), key, size, unit, frame);
  if (status && container == ControlContainer::JointSpaceReference) joints_ = size;
  return status;
}

Status ControlStates::set(ControlContainer container, const std::string& key, const Values& value,
                          const char* who) {
  Status status = checkJoints(container, key, static_cast<int>(value.size()), who);
  if (status) status = table_.set(groupOf(container), key, value, who);
  if (status && container == ControlContainer::JointSpaceReference) {
    joints_ = static_cast<int>(value.size());
  }
  return status;
}

Status ControlStates::getZMP(const std::string& key, Vector3& value, const char* who) const {
  Eigen::VectorXd numbers;
  const Status status = get(ControlContainer::Zmp, key, numbers, who);
  if (status) value = numbers;
  return status;
}

Status ControlStates::setPelvisOrientation(const Eigen::Matrix3d& orientation, const char* who) {
  const double error = (orientation * orientation.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (!(error <= kRotationTolerance) || !(orientation.determinant() > 0.0)) {
    return table_.refuse(std::string(who) +
                         ": pelvisOrientation/pelvis expects a rotation matrix, got " +
                         "one with |R R^T - 1| = " + std::to_string(error) + " and determinant " +
                         std::to_string(orientation.determinant()));
  }
  const Eigen::Vector4d q = Eigen::Quaterniond(orientation).normalized().coeffs();
  return set(ControlContainer::PelvisOrientation, "pelvis", q, who);
}

Status ControlStates::setPelvisOrientation(double roll, double pitch, double yaw, const char* who) {
  if (!std::isfinite(roll) || !std::isfinite(pitch) || !std::isfinite(yaw)) {
    return table_.refuse(std::string(who) +
                         ": pelvisOrientation/pelvis got an angle that is not finite");
  }
  const Eigen::Vector4d q = fromRollPitchYaw(roll, pitch, yaw).normalized().coeffs();
  return set(ControlContainer::PelvisOrientation, "pelvis", q, who);
}

Eigen::Matrix3d ControlStates::getPelvisOrientation() const {
  const Reference<4> pelvis = find<4>(ControlContainer::PelvisOrientation, "pelvis");
  return Eigen::Quaterniond(view(pelvis)).normalized().toRotationMatrix();
}

ControlSignal ControlStates::find(ControlContainer container, const std::string& key) const {
  return ControlSignal(table_.find(groupOf(container), key));
}

ControlSignal ControlStates::findSized(ControlContainer container, const std::string& key,
                                       int size) const {
  const ControlSignal signal = find(container, key);
  if (!signal.valid()) {
    throw std::invalid_argument(table_.unknownKey(groupOf(container), key, "find"));
  }
  if (size != AnySize && signal.size() != size) {
    throw std::invalid_argument("find: " + nameOfSignal(signal) + " has size " +
                                std::to_string(signal.size()) + ", asked for " +
                                std::to_string(size));
  }
  return signal;
}

void ControlStates::copyValuesFrom(const ControlStates& other) {
  if (dataSize() == other.dataSize()) {
    std::memcpy(data(), other.data(), dataSize() * sizeof(double));
  }
}

Status ControlStates::setControlPeriod(double period_s) {
  if (!(period_s > 0.0 && period_s < 1.0)) {
    return table_.refuse("control period must be between 0 and 1 s, got " +
                         std::to_string(period_s));
  }
  period_s_ = period_s;
  return {};
}

std::vector<SignalInfo> ControlStates::signals(ControlContainer container) const {
  return table_.signals(groupOf(container));
}

std::string ControlStates::nameOfSignal(ControlSignal signal) const {
  return table_.entries().at(signal.index()).name();
}

void ControlStates::print(std::ostream& out) const {
  for (const SignalTable::Entry& entry : table_.entries()) {
    out << entry.group->name << '/' << SignalTable::label(entry.info) << ':'
        << table_.numbers(entry.info) << '\n';
  }
}

}  // namespace ctrl_more
