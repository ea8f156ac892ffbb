#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "ctrl_more/feedback_controller.hpp"

namespace ctrl_more {

/// Controls the orientation of a body with an IMU (pelvis, torso, hand) by proportional, integral
/// and damping action on SO(3).
class Attitude : public FeedbackController {
 public:
  Description describe() const override;
  void initialize(Setup& setup) override;
  void update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
              ModifiedControlStates& modified) override;
  void reset() override { integral_.setZero(); }
  void state(Numbers<> values) const override { values.head<3>() = integral_; }

 private:
  struct Imu {
    Eigen::Quaterniond orientation;  // orientation of the IMU in the world frame
    Eigen::Vector3d rate;            // angular velocity in the IMU frame [rad/s]
  };
  Imu read(const RobotStates& robot) const;

  enum class Layout { RollPitchYaw, QuaternionGyro, QuaternionAcc, QuaternionWxyzAcc };
  Layout layout_ = Layout::RollPitchYaw;
  Eigen::Quaterniond mount_ = Eigen::Quaterniond::Identity();  // body to IMU
  Read<> imu_;
  Modify<> target_;
  int first_ = 0;  // index of the quaternion in the target
  Gain kp_, ki_, kd_, max_angle_, dead_band_;
  LogThrottle said_{1'000'000'000};
  Eigen::Vector3d integral_ = Eigen::Vector3d::Zero();  // Ki times the integral of e [rad]
};

Description Attitude::describe() const {
  Description d;
  d.type = "Attitude";
  d.summary = "Keeps the orientation of a body that carries an IMU at its reference.";
  d.use =
      "Write the IMU into `measuredData` under the key of the setting `imu`, in the order that "
      "`imu_layout` names. Set in `mount` how the IMU is mounted on the body, and in `target` "
      "which reference orientation is corrected: the pelvis, or the orientation of the pose "
      "`pose`. The same library serves any robot: only this file differs.";
  d.when =
      "While standing, walking or carrying, when the measured orientation of the body differs "
      "from the reference because of compliance or pushes. Not while the body must leave its "
      "reference, for example during a get-up motion.";
  d.limitations =
      "Corrects orientation only, one body per instance. Trusts the IMU's orientation: a drifting "
      "yaw is followed unless the gains about the body's z axis are zero. With a plant that "
      "answers one cycle late, kp must stay below 1.";
  d.law =
      "e = \\log(R_{ref} R_m^T),\\quad \\delta = \\mathrm{sat}_{max}(R_{ref}(K_p e_b - "
      "K_d \\omega_b + K_i \\textstyle\\int e_b)),\\quad R' = \\exp(\\delta) R";
  d.source =
      "Proportional, integral and damping feedback on SO(3); written for this project. The "
      "Ctrl-MORE paper (section VI-A) uses an attitude controller as its example without giving "
      "its law.";
  d.information =
      "Gains act about the axes of the reference body (index b), so the result does not depend on "
      "the world frame. The integral holds K_i times the error, so a new gain changes nothing at "
      "once; it stands still while the output is saturated and would grow.";
  d.stage = Stage::Task;
  d.measured("imu")
      .keyFrom("imu")
      .size(9)
      .size(10)
      .in("rad or 1, rad/s, m/s^2")
      .frameOf("orientation: world; rates: IMU")
      .maxAge(0.05)
      .about("orientation, angular velocity and linear acceleration in the order of `imu_layout`");
  const CorrectionLimit limit{kUnlimited, kUnlimited, 1.2, 60.0};
  d.modifies(ControlContainer::PelvisOrientation, "pelvis")
      .in("1")
      .frameOf("world")
      .bounded(limit)
      .ifAsked()
      .about("orientation reference of the pelvis, if `target` is `pelvis`");
  d.modifies(ControlContainer::TaskSpaceReferencePose, "pose")
      .keyFrom("pose")
      .in("m, 1")
      .frameOf("world")
      .bounded({1e-12, kUnlimited, 1.2, 60.0})
      .ifAsked()
      .about("pose whose orientation is corrected, if `target` is `pose`");
  d.gain("kp", 0).vector(3, 0.5).range(0.0, 5.0).in("1").about("share of the error corrected");
  d.gain("ki", 0).vector(3, 0.0).range(0.0, 50.0).in("1/s").about("integral action");
  d.gain("kd", 0).vector(3, 0.02).range(0.0, 2.0).in("s").about("damping of the measured rate");
  d.gain("max_angle", 0.3).range(0.0, 1.0).in("rad").about("largest correction");
  d.gain("dead_band", 0.0).range(0.0, 0.2).in("rad").about("errors below it count as zero");
  d.addStates({"integral_x", "integral_y", "integral_z"}, "rad",
              "integral part about this axis of the body");
  d.setting("imu", "imu").about("key of the IMU in `measuredData`");
  d.setting("imu_layout", "rpy_gyro_acc")
      .oneOf({"rpy_gyro_acc", "quaternion_gyro_acc", "quaternion_acc_gyro",
              "quaternion_wxyz_acc_gyro"})
      .about("order of the IMU's numbers; roll, pitch, yaw mean Rz Ry Rx, `quaternion` x y z w");
  d.setting("mount", std::vector<double>{0, 0, 0, 1})
      .range(-1.0, 1.0)
      .in("1")
      .about("orientation of the IMU in the body frame, quaternion x y z w");
  d.setting("target", "pelvis")
      .oneOf({"pelvis", "pose"})
      .about("which orientation reference is corrected");
  d.setting("pose", "torso").about("key of the pose, if `target` is `pose`");
  return d;
}

void Attitude::initialize(Setup& setup) {
  const std::string& layout = setup.text("imu_layout");
  layout_ = layout == "rpy_gyro_acc"          ? Layout::RollPitchYaw
            : layout == "quaternion_gyro_acc" ? Layout::QuaternionGyro
            : layout == "quaternion_acc_gyro" ? Layout::QuaternionAcc
                                              : Layout::QuaternionWxyzAcc;
  imu_ = setup.read("imu", layout_ == Layout::RollPitchYaw ? 9 : 10);
  const std::vector<double>& m = setup.numbers("mount");
  mount_ = Eigen::Quaterniond(m[3], m[0], m[1], m[2]);
  if (std::abs(mount_.norm() - 1.0) > 1e-3) {
    throw std::invalid_argument("setting 'mount' must be a unit quaternion x y z w, got norm " +
                                std::to_string(mount_.norm()));
  }
  mount_.normalize();
  const bool pelvis = setup.text("target") == "pelvis";
  target_ = setup.modify(pelvis ? "pelvis" : "pose");
  first_ = pelvis ? 0 : 3;
  kp_ = setup.gain("kp");
  ki_ = setup.gain("ki");
  kd_ = setup.gain("kd");
  max_angle_ = setup.gain("max_angle");
  dead_band_ = setup.gain("dead_band");
}

Attitude::Imu Attitude::read(const RobotStates& robot) const {
  const auto values = robot.view(imu_);
  Imu imu;
  switch (layout_) {
    case Layout::RollPitchYaw:
      imu.orientation = fromRollPitchYaw(values[0], values[1], values[2]);
      imu.rate = values.segment<3>(3);
      break;
    case Layout::QuaternionGyro:
      imu.orientation.coeffs() = values.head<4>();
      imu.rate = values.segment<3>(4);
      break;
    case Layout::QuaternionAcc:
      imu.orientation.coeffs() = values.head<4>();
      imu.rate = values.segment<3>(7);
      break;
    case Layout::QuaternionWxyzAcc:
      imu.orientation.coeffs() << values[1], values[2], values[3], values[0];
      imu.rate = values.segment<3>(7);
      break;
  }
  return imu;
}

void Attitude::update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
                      ModifiedControlStates& modified) {
  const Imu imu = read(robot);
  if (!(std::abs(imu.orientation.norm() - 1.0) <= 1e-2)) {
    fail("the IMU's quaternion is not unit");
    return;
  }
  const Eigen::Quaterniond body = imu.orientation.normalized() * mount_.conjugate();
  const Eigen::Quaterniond reference(original.view(target_).segment<4>(first_).data());
  const Eigen::Vector3d rate_world = imu.orientation.normalized() * imu.rate;

  // Error and rate in the frame of the reference body.
  Eigen::Vector3d error = reference.conjugate() * logOf(reference * body.conjugate());
  const double size = error.norm();
  const double dead_band = scalar(dead_band_);
  error *= size > dead_band ? 1.0 - dead_band / size : 0.0;
  const Eigen::Vector3d rate = reference.conjugate() * rate_world;

  const Eigen::Vector3d kp = gain(kp_), ki = gain(ki_), kd = gain(kd_);
  const Eigen::Vector3d grown = integral_ + cycle.dt * ki.cwiseProduct(error);
  Eigen::Vector3d correction = kp.cwiseProduct(error) - kd.cwiseProduct(rate) + grown;
  const double max_angle = scalar(max_angle_);
  const double angle = correction.norm();
  if (angle > max_angle) {
    correction *= max_angle / angle;
    if (said_.pass(cycle.now_ns)) {
      CTRL_MORE_LOG(log(), Warning, "correction of {} rad is held at max_angle, {} rad", angle,
                    max_angle);
    }
    // Anti-windup: while saturated, the integral may decrease but not increase.
    if (grown.norm() < integral_.norm()) integral_ = grown;
  } else {
    integral_ = grown;
  }
  if (correction.isZero(0.0)) return;
  auto target = modified[target_];
  const Eigen::Quaterniond before(target.segment<4>(first_).data());
  const Eigen::Quaterniond after = expOf(reference * correction) * before;
  target.segment<4>(first_) = after.normalized().coeffs();
}

}  // namespace ctrl_more

CTRL_MORE_REGISTER_CONTROLLER(ctrl_more::Attitude, "Attitude")
