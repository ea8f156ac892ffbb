#include <algorithm>
#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "ctrl_more/feedback_controller.hpp"
#include "second_order.hpp"

namespace ctrl_more {

/// Makes an end-effector yield to a hand that pushes or pulls it, in addition to the current
/// motion.
class EeAdmittance : public FeedbackController {
 public:
  Description describe() const override;
  void initialize(Setup& setup) override;
  void update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
              ModifiedControlStates& modified) override;
  void reset() override {
    offset_.setZero();
    velocity_.setZero();
    force_.setZero();
  }
  void state(Numbers<> values) const override {
    values.head<6>() = offset_;
    values.tail<3>() = force_;
  }

 private:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  bool in_tool_frame_ = false;
  bool rotates_ = false;
  Read<Wrench> wrench_;
  Modify<Pose> pose_;
  Modify<Twist> twist_;
  Gain mass_, damping_, stiffness_, inertia_, rotary_damping_, rotary_stiffness_;
  Gain force_dead_band_, torque_dead_band_, max_offset_, max_angle_, max_velocity_;
  SecondOrderAxes<3> shift_, turn_;
  Vector6 offset_ = Vector6::Zero();                 // [m], [rad]
  Vector6 velocity_ = Vector6::Zero();               // [m/s], [rad/s]
  Eigen::Vector3d force_ = Eigen::Vector3d::Zero();  // force that moves it, base frame [N]
  LogThrottle said_{1'000'000'000};
};

namespace {

// Dead band without a step at its edge; exactly zero inside.
Eigen::Vector3d withoutDeadBand(const Eigen::Vector3d& value, double dead_band) {
  const double size = value.norm();
  if (size <= dead_band) return Eigen::Vector3d::Zero();
  return (1.0 - dead_band / size) * value;
}

// Limits an offset to a ball of radius `limit`. At the limit it removes the outward velocity.
template <typename Offset, typename Velocity>
void bound(Offset offset, Velocity velocity, double limit) {
  const double size = offset.norm();
  if (size <= limit) return;
  const Eigen::Vector3d direction = offset / size;
  offset = limit * direction;
  const double outward = velocity.dot(direction);
  if (outward > 0.0) velocity -= outward * direction;
}

/// Bound for a length of the value `before`. If the limit was reduced below it, the bound returns
/// to the limit with a time constant instead of at once.
double eased(double limit, double before, double dt) noexcept {
  constexpr double kReturn = 0.3;  // s
  return limit + std::max(0.0, before - limit) * std::max(0.0, 1.0 - dt / kReturn);
}

void declareGains(Description& d) {
  d.gain("mass", 0).vector(3, 4.0).range(0.1, 100.0).in("kg").about("virtual mass, x y z");
  d.gain("damping", 0).vector(3, 60.0).range(0.0, 1e4).in("N s/m").about("virtual damper, x y z");
  d.gain("stiffness", 0)
      .vector(3, 200.0)
      .range(0.0, 1e5)
      .in("N/m")
      .about("virtual spring, x y z; 0: stays where it is led");
  d.gain("inertia", 0)
      .vector(3, 0.2)
      .range(0.001, 10.0)
      .in("kg m^2")
      .about("virtual inertia about x y z (axes: all)");
  d.gain("rotary_damping", 0)
      .vector(3, 3.0)
      .range(0.0, 1e3)
      .in("Nm s/rad")
      .about("virtual damper about x y z (axes: all)");
  d.gain("rotary_stiffness", 0)
      .vector(3, 10.0)
      .range(0.0, 1e4)
      .in("Nm/rad")
      .about("virtual spring about x y z (axes: all)");
  d.gain("force_dead_band", 3.0).range(0.0, 100.0).in("N").about("forces below it count as zero");
  d.gain("torque_dead_band", 0.5).range(0.0, 50.0).in("Nm").about("torques below it count as zero");
  d.gain("max_offset", 0.15).range(0.0, 0.4).in("m").about("largest distance from the reference");
  d.gain("max_angle", 0.5).range(0.0, 1.5).in("rad").about("largest turn from the reference");
  d.gain("max_velocity", 0.25).range(0.0, 2.0).in("m/s").about("largest yielding speed");
}

}  // namespace

Description EeAdmittance::describe() const {
  Description d;
  d.type = "EeAdmittance";
  d.summary = "Lets the end-effector yield to external force like a mass on a damper and a spring.";
  d.use =
      "Write the external wrench at the end-effector (without its own weight and that of the "
      "object) into `measuredData` under the key of the setting `wrench`, and pose and velocity "
      "references under the key of the setting `ee`. Runs between the motion controller and the "
      "inverse kinematics, and shifts pose and velocity together, so that a controller which "
      "closes its loop on the pose follows.";
  d.when =
      "While a person may touch the arm: guiding, waiting, approaching. Switch it off before "
      "contact detection by force is armed: a yielding hand hides the contact. "
      "With stiffness 0 the hand stays where a person moves it.";
  d.limitations =
      "A stiff contact with little virtual mass can oscillate: raise `mass` and `damping`. It is "
      "no safety function. Rotation yields only with `axes: all`.";
  d.law =
      "M \\ddot x + D \\dot x + K x = \\mathrm{deadband}(F_{ext}),\\quad p' = p + x,\\ "
      "\\dot p' = \\dot p + \\dot x";
  d.source = "Mass-spring-damper admittance, discretised exactly for a force held over a cycle.";
  d.information =
      "Below the dead band, from rest, the references stay bit-identical. Offset and velocity are "
      "bounded in norm; at the bound the outward velocity is removed.";
  d.measured("wrench")
      .keyFrom("wrench")
      .size(6)
      .in("N, Nm")
      .frameOf("setting `wrench_frame`")
      .maxAge(0.1)
      .about("external force and torque on the end-effector");
  d.modifies(ControlContainer::TaskSpaceReferencePose, "ee")
      .keyFrom("ee")
      .in("m, 1")
      .frameOf("base")
      .bounded({0.5, 5.0, 1.6, 30.0})
      .about("the yielded offset is added");
  d.modifies(ControlContainer::TaskSpaceReferenceVel, "ee")
      .keyFrom("ee")
      .in("m/s, rad/s")
      .frameOf("base")
      .bounded({5.0, kUnlimited, kUnlimited, kUnlimited})
      .about("the velocity of the offset is added");
  declareGains(d);
  d.addStates({"offset_x", "offset_y", "offset_z"}, "m", "yielded distance");
  d.addStates({"turn_x", "turn_y", "turn_z"}, "rad", "yielded rotation vector (axes: all)");
  d.addStates({"force_x", "force_y", "force_z"}, "N",
              "force that moves it, without its dead band, base frame");
  d.setting("wrench", "wrench").about("key of the wrench in `measuredData`");
  d.setting("ee", "ee").about("key of pose and velocity references");
  d.setting("wrench_frame", "base")
      .oneOf({"base", "tool"})
      .about("frame the wrench is expressed in");
  d.setting("axes", "translation")
      .oneOf({"translation", "all"})
      .about("whether orientation yields too");
  return d;
}

void EeAdmittance::initialize(Setup& setup) {
  in_tool_frame_ = setup.text("wrench_frame") == "tool";
  rotates_ = setup.text("axes") == "all";
  wrench_ = setup.read<Wrench>("wrench");
  pose_ = setup.modify<Pose>("taskSpaceReferencePose/ee");
  twist_ = setup.modify<Twist>("taskSpaceReferenceVel/ee");
  mass_ = setup.gain("mass");
  damping_ = setup.gain("damping");
  stiffness_ = setup.gain("stiffness");
  inertia_ = setup.gain("inertia");
  rotary_damping_ = setup.gain("rotary_damping");
  rotary_stiffness_ = setup.gain("rotary_stiffness");
  force_dead_band_ = setup.gain("force_dead_band");
  torque_dead_band_ = setup.gain("torque_dead_band");
  max_offset_ = setup.gain("max_offset");
  max_angle_ = setup.gain("max_angle");
  max_velocity_ = setup.gain("max_velocity");
}

void EeAdmittance::update(const Cycle& cycle, const RobotStates& robot, const ControlStates&,
                          ModifiedControlStates& modified) {
  const auto wrench = robot.view(wrench_);
  Eigen::Vector3d force = withoutDeadBand(wrench.head<3>(), scalar(force_dead_band_));
  Eigen::Vector3d torque = withoutDeadBand(wrench.tail<3>(), scalar(torque_dead_band_));
  if (in_tool_frame_) {
    // The sensor turns with the tool: by the reference and by this controller's own offset.
    const Eigen::Quaterniond reference(modified.view(pose_).tail<4>().data());
    const Eigen::Quaterniond tool = expOf(offset_.tail<3>()) * reference;
    force = tool * force;
    torque = tool * torque;
  }
  force_ = force;
  const Eigen::Vector3d before = offset_.head<3>();
  shift_.step(gain(mass_), gain(damping_), gain(stiffness_), cycle.dt, force, offset_.head<3>(),
              velocity_.head<3>());
  const double speed = velocity_.head<3>().norm();
  const double max_velocity = scalar(max_velocity_);
  if (speed > max_velocity) {
    // The limited offset must match the velocity that is sent with it, in the direction of both.
    velocity_.head<3>() *= max_velocity / speed;
    offset_.head<3>() = before + cycle.dt * velocity_.head<3>();
  }
  const double max_offset = scalar(max_offset_);
  if (offset_.head<3>().norm() > max_offset && said_.pass(cycle.now_ns)) {
    CTRL_MORE_LOG(log(), Warning, "a force of {} N holds it at max_offset, {} m", force.norm(),
                  max_offset);
  }
  bound(offset_.head<3>(), velocity_.head<3>(), eased(max_offset, before.norm(), cycle.dt));
  if (rotates_) {
    const double turned = offset_.tail<3>().norm();
    turn_.step(gain(inertia_), gain(rotary_damping_), gain(rotary_stiffness_), cycle.dt, torque,
               offset_.tail<3>(), velocity_.tail<3>());
    bound(offset_.tail<3>(), velocity_.tail<3>(), eased(scalar(max_angle_), turned, cycle.dt));
  }
  if (offset_.isZero(0.0) && velocity_.isZero(0.0)) return;  // the references keep every bit
  auto pose = modified[pose_];
  pose.head<3>() += offset_.head<3>();
  if (rotates_) {
    const Eigen::Quaterniond before(pose.tail<4>().data());
    pose.tail<4>() = (expOf(offset_.tail<3>()) * before).normalized().coeffs();
  }
  modified[twist_] += velocity_;
}

}  // namespace ctrl_more

CTRL_MORE_REGISTER_CONTROLLER(ctrl_more::EeAdmittance, "EeAdmittance")
