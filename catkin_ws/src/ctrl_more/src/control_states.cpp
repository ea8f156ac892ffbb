#include "ctrl_more/control_states.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "ctrl_more/config_node.hpp"
#include "ctrl_more/logger.hpp"
#include "ctrl_more/so3.hpp"

namespace ctrl_more {
namespace {

constexpr double kUnitTolerance = 1e-6;
constexpr double kRotationTolerance = 1e-3;

std::string fullName(ControlContainer container, const std::string& key) {
  return std::string(nameOf(container)) + "/" + key;
}

bool isUnit(const double* q) {
  return std::abs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) <=
         2.0 * kUnitTolerance;
}

}  // namespace

ControlStates::ControlStates(int joints, double period_s, Logger* logger)
    : logger_(logger ? logger : &Logger::standard()), joints_(joints), period_s_(period_s) {
  using C = ControlContainer;
  const char* who = "ControlStates";
  add(C::CentreOfMass, "com", 3, "m", "world", who, false);
  add(C::CentreOfMass, "comVelocity", 3, "m/s", "world", who, false);
  add(C::CentreOfMass, "comAcceleration", 3, "m/s^2", "world", who, false);
  add(C::LinearMomentum, "linearMomentum", 3, "kg m/s", "world", who, false);
  add(C::AngularMomentum, "angularMomentum", 3, "kg m^2/s", "world", who, false);
  add(C::Zmp, "zmp", 3, "m", "world", who, false);
  add(C::PelvisOrientation, "pelvis", 4, "1", "world", who, false);
}

Status ControlStates::refuse(const std::string& text) const {
  logger_->log(LogLevel::Warning, "ControlStates", text);
  return Status::failure(text);
}

std::string ControlStates::unknownKey(ControlContainer container, const std::string& key,
                                      const char* who) const {
  std::vector<std::string> known;
  for (const Entry& entry : entries_) {
    if (entry.container == container) known.push_back(entry.info.key);
  }
  return std::string(who) + ": " + nameOf(container) + " has no key '" + key + "'" +
         suggestion(key, known);
}

Status ControlStates::add(ControlContainer container, const std::string& key, int size,
                          const std::string& unit, const std::string& frame, const char* who,
                          bool announce) {
  const std::string what = std::string(who) + ": " + fullName(container, key);
  if (key.empty() || size <= 0) {
    return refuse(what + " needs a name and at least one number, got size " +
                  std::to_string(size));
  }
  const int fixed = container == ControlContainer::JointSpaceReference ? joints_
                                                                       : fixedSizeOf(container);
  if (fixed != 0 && size != fixed) {
    return refuse(what + " expects " + std::to_string(fixed) + " numbers, got " +
                  std::to_string(size));
  }
  if (container == ControlContainer::JointSpaceReference && key != "Position" &&
      key != "Velocity" && key != "Torque") {
    return refuse(what + " is no type of jointSpaceReference" +
                  suggestion(key, {"Position", "Velocity", "Torque"}));
  }
  if (frozen_) {
    return refuse(unknownKey(container, key, who) +
                  "; the states are frozen: declare it before the first cycle");
  }
  if (container == ControlContainer::JointSpaceReference) joints_ = size;
  Entry entry;
  entry.container = container;
  entry.info = {key, unit, frame, static_cast<std::uint32_t>(data_.size()),
                static_cast<std::uint32_t>(size), kindOf(container)};
  index_[fullName(container, key)] = static_cast<std::uint32_t>(entries_.size());
  entries_.push_back(entry);
  data_.resize(data_.size() + size, 0.0);
  // Identity, not zeros, wherever a quaternion lives.
  if (entry.info.kind != SignalKind::Vector) data_.back() = 1.0;
  if (announce) {
    logger_->log(LogLevel::Info, "ControlStates",
                 "new key " + fullName(container, key) + " of size " + std::to_string(size) +
                     ", added by " + who);
  }
  return {};
}

Status ControlStates::declare(ControlContainer container, const std::string& key, int size,
                              const std::string& unit, const std::string& frame) {
  const auto found = index_.find(fullName(container, key));
  if (found == index_.end()) return add(container, key, size, unit, frame, "declare", true);
  SignalInfo& info = entries_[found->second].info;
  if (static_cast<int>(info.size) != size) {
    return refuse("declare: " + fullName(container, key) + " has size " +
                  std::to_string(info.size) + ", got " + std::to_string(size) +
                  "; a key keeps its size");
  }
  if (info.unit.empty()) info.unit = unit;
  if (info.frame.empty()) info.frame = frame;
  return {};
}

Status ControlStates::set(ControlContainer container, const std::string& key,
                          const Eigen::Ref<const Eigen::VectorXd>& value, const char* who) {
  const std::string name = fullName(container, key);
  auto found = index_.find(name);
  const int fixed = fixedSizeOf(container);
  int expected = found != index_.end() ? static_cast<int>(entries_[found->second].info.size)
                 : fixed != 0          ? fixed
                                       : static_cast<int>(value.size());
  if (value.size() != expected) {
    return refuse(std::string(who) + ": " + name + " expects " + std::to_string(expected) +
                  " numbers, got " + std::to_string(value.size()) + "; the old value stays");
  }
  if (!value.allFinite()) {
    return refuse(std::string(who) + ": " + name +
                  " got a number that is not finite; the old value stays");
  }
  if (kindOf(container) != SignalKind::Vector && !isUnit(value.data() + value.size() - 4)) {
    return refuse(std::string(who) + ": " + name + " expects a unit quaternion x y z w, got norm " +
                  std::to_string(value.tail(4).norm()) + "; normalise it first");
  }
  if (found == index_.end()) {
    const Status added = add(container, key, expected, "", "", who, true);
    if (!added) return added;
    found = index_.find(name);
  }
  std::copy(value.data(), value.data() + value.size(),
            data_.begin() + entries_[found->second].info.offset);
  return {};
}

Status ControlStates::get(ControlContainer container, const std::string& key,
                          Eigen::VectorXd& value, const char* who) const {
  const auto found = index_.find(fullName(container, key));
  if (found == index_.end()) return refuse(unknownKey(container, key, who));
  const SignalInfo& info = entries_[found->second].info;
  value = Eigen::Map<const Eigen::VectorXd>(data_.data() + info.offset, info.size);
  return {};
}

Eigen::Vector3d ControlStates::get3(ControlContainer container, const char* key) const {
  return view(find<3>(container, key));
}

Status ControlStates::setTaskSpaceReferencePose(const std::string& key,
                                                const Eigen::Ref<const Eigen::VectorXd>& pose,
                                                const char* who) {
  return set(ControlContainer::TaskSpaceReferencePose, key, pose, who);
}

Status ControlStates::setTaskSpaceReferencePose(const std::string& key,
                                                const Eigen::Isometry3d& pose, const char* who) {
  Eigen::VectorXd values(7);
  values << pose.translation(), Eigen::Quaterniond(pose.linear()).normalized().coeffs();
  return set(ControlContainer::TaskSpaceReferencePose, key, values, who);
}

Status ControlStates::setTaskSpaceReferenceVel(const std::string& key,
                                               const Eigen::Ref<const Eigen::VectorXd>& velocity,
                                               const char* who) {
  return set(ControlContainer::TaskSpaceReferenceVel, key, velocity, who);
}

Status ControlStates::setTaskSpaceReferenceAcc(
    const std::string& key, const Eigen::Ref<const Eigen::VectorXd>& acceleration,
    const char* who) {
  return set(ControlContainer::TaskSpaceReferenceAcc, key, acceleration, who);
}

Status ControlStates::setJointSpaceReference(const std::string& type,
                                             const Eigen::Ref<const Eigen::VectorXd>& reference,
                                             const char* who) {
  return set(ControlContainer::JointSpaceReference, type, reference, who);
}

Status ControlStates::setOtherReference(const std::string& key,
                                        const Eigen::Ref<const Eigen::VectorXd>& reference,
                                        const char* who) {
  return set(ControlContainer::OtherReference, key, reference, who);
}

Status ControlStates::setCoM(const Eigen::Vector3d& position, const char* who) {
  return set(ControlContainer::CentreOfMass, "com", position, who);
}

Status ControlStates::setCoMVelocity(const Eigen::Vector3d& velocity, const char* who) {
  return set(ControlContainer::CentreOfMass, "comVelocity", velocity, who);
}

Status ControlStates::setCoMAcceleration(const Eigen::Vector3d& acceleration, const char* who) {
  return set(ControlContainer::CentreOfMass, "comAcceleration", acceleration, who);
}

Status ControlStates::setLinearMomentum(const Eigen::Vector3d& momentum, const char* who) {
  return set(ControlContainer::LinearMomentum, "linearMomentum", momentum, who);
}

Status ControlStates::setAngularMomentum(const Eigen::Vector3d& momentum, const char* who) {
  return set(ControlContainer::AngularMomentum, "angularMomentum", momentum, who);
}

Status ControlStates::setZMP(const Eigen::Vector3d& zmp, const char* who) {
  return set(ControlContainer::Zmp, "zmp", zmp, who);
}

Status ControlStates::setZMP(const std::string& key, const Eigen::Vector3d& zmp,
                             const char* who) {
  return set(ControlContainer::Zmp, key, zmp, who);
}

Status ControlStates::setPelvisOrientation(const Eigen::Matrix3d& orientation, const char* who) {
  const double error =
      (orientation * orientation.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (!(error <= kRotationTolerance) || !(orientation.determinant() > 0.0)) {
    return refuse(std::string(who) + ": pelvisOrientation/pelvis expects a rotation matrix, got " +
                  "one with |R R^T - 1| = " + std::to_string(error) + " and determinant " +
                  std::to_string(orientation.determinant()));
  }
  const Eigen::Vector4d q = Eigen::Quaterniond(orientation).normalized().coeffs();
  return set(ControlContainer::PelvisOrientation, "pelvis", q, who);
}

Status ControlStates::setPelvisOrientation(double roll, double pitch, double yaw,
                                           const char* who) {
  if (!std::isfinite(roll) || !std::isfinite(pitch) || !std::isfinite(yaw)) {
    return refuse(std::string(who) + ": pelvisOrientation/pelvis got an angle that is not finite");
  }
  const Eigen::Vector4d q = fromRollPitchYaw(roll, pitch, yaw).normalized().coeffs();
  return set(ControlContainer::PelvisOrientation, "pelvis", q, who);
}

Status ControlStates::getTaskSpaceReferencePose(const std::string& key, Eigen::VectorXd& pose,
                                                const char* who) const {
  return get(ControlContainer::TaskSpaceReferencePose, key, pose, who);
}

Status ControlStates::getTaskSpaceReferenceVel(const std::string& key, Eigen::VectorXd& velocity,
                                               const char* who) const {
  return get(ControlContainer::TaskSpaceReferenceVel, key, velocity, who);
}

Status ControlStates::getTaskSpaceReferenceAcc(const std::string& key,
                                               Eigen::VectorXd& acceleration,
                                               const char* who) const {
  return get(ControlContainer::TaskSpaceReferenceAcc, key, acceleration, who);
}

Status ControlStates::getJointSpaceReference(const std::string& type, Eigen::VectorXd& reference,
                                             const char* who) const {
  return get(ControlContainer::JointSpaceReference, type, reference, who);
}

Status ControlStates::getOtherReference(const std::string& key, Eigen::VectorXd& reference,
                                        const char* who) const {
  return get(ControlContainer::OtherReference, key, reference, who);
}

Status ControlStates::getZMP(const std::string& key, Eigen::Vector3d& zmp,
                             const char* who) const {
  Eigen::VectorXd value;
  const Status status = get(ControlContainer::Zmp, key, value, who);
  if (status) zmp = value;
  return status;
}

Eigen::Vector3d ControlStates::getCoM() const {
  return get3(ControlContainer::CentreOfMass, "com");
}
Eigen::Vector3d ControlStates::getCoMVelocity() const {
  return get3(ControlContainer::CentreOfMass, "comVelocity");
}
Eigen::Vector3d ControlStates::getCoMAcceleration() const {
  return get3(ControlContainer::CentreOfMass, "comAcceleration");
}
Eigen::Vector3d ControlStates::getLinearMomentum() const {
  return get3(ControlContainer::LinearMomentum, "linearMomentum");
}
Eigen::Vector3d ControlStates::getAngularMomentum() const {
  return get3(ControlContainer::AngularMomentum, "angularMomentum");
}
Eigen::Vector3d ControlStates::getZMP() const { return get3(ControlContainer::Zmp, "zmp"); }

Eigen::Matrix3d ControlStates::getPelvisOrientation() const {
  const Reference<4> pelvis = find<4>(ControlContainer::PelvisOrientation, "pelvis");
  return Eigen::Quaterniond(view(pelvis)).normalized().toRotationMatrix();
}

ControlSignal ControlStates::find(ControlContainer container, const std::string& key) const {
  ControlSignal signal;
  const auto found = index_.find(fullName(container, key));
  if (found == index_.end()) return signal;
  signal.offset_ = entries_[found->second].info.offset;
  signal.size_ = entries_[found->second].info.size;
  signal.index_ = found->second;
  return signal;
}

ControlSignal ControlStates::findSized(ControlContainer container, const std::string& key,
                                       int size) const {
  const ControlSignal signal = find(container, key);
  if (!signal.valid()) throw std::invalid_argument(unknownKey(container, key, "find"));
  if (size != AnySize && signal.size() != size) {
    throw std::invalid_argument("find: " + fullName(container, key) + " has size " +
                                std::to_string(signal.size()) + ", asked for " +
                                std::to_string(size));
  }
  return signal;
}

std::vector<int> ControlStates::offsets() const {
  std::vector<int> list;
  for (const Entry& entry : entries_) list.push_back(static_cast<int>(entry.info.offset));
  return list;
}

void ControlStates::copyValuesFrom(const ControlStates& other) {
  if (data_.size() == other.data_.size()) {
    std::memcpy(data_.data(), other.data_.data(), data_.size() * sizeof(double));
  }
}

Status ControlStates::setControlPeriod(double period_s) {
  if (!(period_s > 0.0 && period_s < 1.0)) {
    return refuse("control period must be between 0 and 1 s, got " + std::to_string(period_s));
  }
  period_s_ = period_s;
  return {};
}

std::vector<SignalInfo> ControlStates::signals(ControlContainer container) const {
  std::vector<SignalInfo> list;
  for (const Entry& entry : entries_) {
    if (entry.container == container) list.push_back(entry.info);
  }
  return list;
}

std::string ControlStates::nameOfSignal(ControlSignal signal) const {
  const Entry& entry = entries_.at(signal.index_);
  return fullName(entry.container, entry.info.key);
}

void ControlStates::print(std::ostream& out) const {
  for (const Entry& entry : entries_) {
    out << fullName(entry.container, entry.info.key) << " [" << entry.info.size << ']';
    if (!entry.info.unit.empty()) out << " (" << entry.info.unit << ')';
    if (!entry.info.frame.empty()) out << " in " << entry.info.frame;
    out << ':';
    for (std::uint32_t k = 0; k < entry.info.size; ++k) out << ' ' << data_[entry.info.offset + k];
    out << '\n';
  }
}

}  // namespace ctrl_more
