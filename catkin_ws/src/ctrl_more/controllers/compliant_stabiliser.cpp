#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "ctrl_more/prototypes.hpp"
#include "second_order.hpp"

namespace ctrl_more {

/// Lets the centre of mass yield to pushes like a mass on a damper and a spring. See
/// doc/controllers/CompliantStabiliser.md.
class CompliantStabiliser : public FeedbackController {
 public:
  Description describe() const override;
  void initialize(Setup& setup) override;
  void update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
              ModifiedControlStates& modified) override;
  void reset() override {
    offset_.setZero();
    velocity_.setZero();
  }
  std::vector<std::pair<std::string, double>> state() const override {
    return {{"offset_x", offset_.x()}, {"offset_y", offset_.y()}};
  }

 private:
  static constexpr double kGravity = 9.80665;  // [m/s^2]
  bool from_zmp_ = true;
  double force_per_metre_ = 0.0;  // m g / h [N/m]
  RobotSignal zmp_, force_;
  ControlSignal zmp_reference_;
  ModifySignal com_, com_velocity_;
  Gain mass_, damping_, stiffness_, max_offset_;
  SecondOrder axis_[2];
  Eigen::Vector2d offset_ = Eigen::Vector2d::Zero();    // [m]
  Eigen::Vector2d velocity_ = Eigen::Vector2d::Zero();  // [m/s]
};

Description CompliantStabiliser::describe() const {
  Description d;
  d.type = "CompliantStabiliser";
  d.summary = "Lets the centre-of-mass reference yield to pushes and come back.";
  d.use =
      "With `force_source: zmp` write the estimated ZMP into `estimatedData` `zmp`; the horizontal "
      "force is then inferred from its distance to the ZMP reference. With `force_source: force` "
      "write the net horizontal contact force into `measuredData` `contactForce`.";
  d.when =
      "For a robot that stands or walks and should give way softly when it is pushed. Not "
      "together with another controller that moves the centre of mass by the same error.";
  d.limitations =
      "Horizontal directions only; no stepping: beyond `max_offset` it pushes back like a wall. "
      "The force from the ZMP is that of a pendulum of constant height.";
  d.law =
      "M \\ddot x + D \\dot x + K x = f,\\quad f = m g (p_{meas} - p_{ref}) / h \\text{ or } "
      "f_{meas},\\quad c' = c + x,\\ \\dot c' = \\dot c + \\dot x";
  d.source = "Mass-spring-damper admittance of the centre of mass, discretised exactly.";
  d.publishes = "`offset_x`, `offset_y`: yielded distance [m].";
  d.estimated("zmp").size(3).in("m").frameOf("world").maxAge(0.05).ifAsked().about(
      "estimated ZMP, if `force_source` is `zmp`");
  d.measured("contactForce").size(3).in("N").frameOf("world").maxAge(0.05).ifAsked().about(
      "net contact force on the robot, if `force_source` is `force`");
  d.reads(ControlContainer::Zmp, "zmp").in("m").frameOf("world").about("ZMP reference");
  d.modifies(ControlContainer::CentreOfMass, "com").in("m").frameOf("world")
      .bounded({0.5, 5.0, kUnlimited, kUnlimited}).whenPaused(StopPolicy::Fade)
      .about("the yielded distance is added to x and y");
  d.modifies(ControlContainer::CentreOfMass, "comVelocity").in("m/s").frameOf("world")
      .bounded({5.0, kUnlimited, kUnlimited, kUnlimited})
      .about("its velocity is added to x and y");
  d.gain("mass", 0).vector(2, 20.0).range(0.1, 1000.0).in("kg").about("virtual mass, x and y");
  d.gain("damping", 0).vector(2, 300.0).range(0.0, 1e5).in("N s/m").about("virtual damper");
  d.gain("stiffness", 0).vector(2, 1000.0).range(0.0, 1e6).in("N/m").about("virtual spring");
  d.gain("max_offset", 0.08).range(0.0, 0.3).in("m").about("largest distance, each axis");
  d.setting("force_source", "zmp").oneOf({"zmp", "force"}).about(
      "where the force comes from");
  d.setting("total_mass", std::vector<double>{40.0}).range(0.1, 1000.0).in("kg").about(
      "mass of the robot");
  d.setting("height", std::vector<double>{0.8}).range(0.05, 5.0).in("m").about(
      "height of the centre of mass");
  return d;
}

void CompliantStabiliser::initialize(Setup& setup) {
  from_zmp_ = setup.text("force_source") == "zmp";
  force_per_metre_ = setup.numbers("total_mass")[0] * kGravity / setup.numbers("height")[0];
  if (from_zmp_) {
    zmp_ = setup.robot("zmp");
  } else {
    force_ = setup.robot("contactForce");
  }
  zmp_reference_ = setup.control("zmp");
  com_ = setup.modify("com");
  com_velocity_ = setup.modify("comVelocity");
  mass_ = setup.gain("mass");
  damping_ = setup.gain("damping");
  stiffness_ = setup.gain("stiffness");
  max_offset_ = setup.gain("max_offset");
}

void CompliantStabiliser::update(const Cycle& cycle, const RobotStates& robot,
                                 const ControlStates& original, ModifiedControlStates& modified) {
  Eigen::Vector2d force;
  if (from_zmp_) {
    force = force_per_metre_ *
            (robot.view<3>(zmp_) - original.view<3>(zmp_reference_)).head<2>();
  } else {
    force = robot.view<3>(force_).head<2>();
  }
  const double limit = scalar(max_offset_);
  for (int i = 0; i < 2; ++i) {
    axis_[i].prepare(gain(mass_)[i], gain(damping_)[i], gain(stiffness_)[i], cycle.dt);
    axis_[i].step(force[i], offset_[i], velocity_[i]);
    if (std::abs(offset_[i]) > limit) {
      offset_[i] = std::copysign(limit, offset_[i]);
      if (offset_[i] * velocity_[i] > 0.0) velocity_[i] = 0.0;
    }
  }
  modified.at<3>(com_).head<2>() += offset_;
  modified.at<3>(com_velocity_).head<2>() += velocity_;
}

}  // namespace ctrl_more

CTRL_MORE_REGISTER_CONTROLLER(ctrl_more::CompliantStabiliser, "CompliantStabiliser")
