#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "ctrl_more/feedback_controller.hpp"
#include "second_order.hpp"

namespace ctrl_more {

/// Lets the centre of mass yield to pushes like a mass with damper and spring. See the page beside
/// this file.
class CompliantStabiliser : public FeedbackController {
 public:
  Description describe() const override;
  void initialize(Setup& setup) override;
  void update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
              ModifiedControlStates& modified) override;
  void reset() override {
    offset_.setZero();
    velocity_.setZero();
    force_estimate_.setZero();
  }
  void state(Numbers<> values) const override {
    values.head<2>() = offset_;
    values.tail<2>() = force_estimate_;
  }

 private:
  static constexpr double kGravity = 9.80665;  // [m/s^2]
  bool from_zmp_ = true;
  double force_per_metre_ = 0.0;  // m g / h [N/m]
  Read<3> zmp_, force_;
  Reference<3> zmp_reference_;
  Modify<3> com_, com_velocity_;
  Gain mass_, damping_, stiffness_, max_offset_, force_filter_;
  SecondOrderAxes<2> axes_;
  Eigen::Vector2d offset_ = Eigen::Vector2d::Zero();          // [m]
  Eigen::Vector2d velocity_ = Eigen::Vector2d::Zero();        // [m/s]
  Eigen::Vector2d force_estimate_ = Eigen::Vector2d::Zero();  // [N]
  LogThrottle said_{1'000'000'000};
};

Description CompliantStabiliser::describe() const {
  Description d;
  d.type = "CompliantStabiliser";
  d.summary = "Lets the centre-of-mass reference yield to pushes and come back.";
  d.use =
      "With `force_source: zmp` write the estimated ZMP into `estimatedData` `zmp`; the horizontal "
      "force is then inferred from its distance to the ZMP reference plus the distance that the "
      "robot has already yielded. With `force_source: force` "
      "write the net horizontal contact force into `measuredData` `contactForce`.";
  d.when =
      "For a robot that stands or walks and should yield softly when it is pushed. Not "
      "together with another controller that moves the centre of mass by the same error.";
  d.limitations =
      "Horizontal directions only; no stepping: beyond `max_offset` it pushes back like a wall. "
      "The force from the ZMP is that of a pendulum of constant height whose centre of mass "
      "follows "
      "its reference. The force that accelerates the robot's own mass counts as a push, so a "
      "quick push meets M + m instead of M. A robot that follows much later than `force_filter` "
      "needs a longer filter.";
  d.law =
      "M \\ddot x + D \\dot x + K x = f,\\quad \\tau \\dot f + f = m g (p_{meas} - p_{ref} - x) / "
      "h "
      "\\text{ or } f = f_{meas},\\quad c' = c + x,\\ \\dot c' = \\dot c + \\dot x";
  d.source = "Mass-spring-damper admittance of the centre of mass, discretised exactly.";
  d.estimated("zmp").size(3).in("m").frameOf("world").maxAge(0.05).ifAsked().about(
      "estimated ZMP, if `force_source` is `zmp`");
  d.measured("contactForce")
      .size(3)
      .in("N")
      .frameOf("world")
      .maxAge(0.05)
      .ifAsked()
      .about("net contact force on the robot, if `force_source` is `force`");
  d.reads(ControlContainer::Zmp, "zmp").in("m").frameOf("world").about("ZMP reference");
  d.modifies(ControlContainer::CentreOfMass, "com")
      .in("m")
      .frameOf("world")
      .bounded({0.5, 5.0, kUnlimited, kUnlimited})
      .whenPaused(StopPolicy::Fade)
      .about("the yielded distance is added to x and y");
  d.modifies(ControlContainer::CentreOfMass, "comVelocity")
      .in("m/s")
      .frameOf("world")
      .bounded({5.0, kUnlimited, kUnlimited, kUnlimited})
      .about("its velocity is added to x and y");
  d.gain("mass", 0).vector(2, 20.0).range(0.1, 1000.0).in("kg").about("virtual mass, x and y");
  d.gain("damping", 0).vector(2, 300.0).range(0.0, 1e5).in("N s/m").about("virtual damper");
  d.gain("stiffness", 0).vector(2, 1000.0).range(0.0, 1e6).in("N/m").about("virtual spring");
  d.gain("max_offset", 0.08).range(0.0, 0.3).in("m").about("largest distance, each axis");
  d.gain("force_filter", 0.05)
      .range(0.01, 1.0)
      .in("s")
      .about("time constant tau of the force inferred from the ZMP");
  d.addStates({"offset_x", "offset_y"}, "m", "yielded distance");
  d.addStates({"force_x", "force_y"}, "N", "force that moves it");
  d.setting("force_source", "zmp").oneOf({"zmp", "force"}).about("where the force comes from");
  d.setting("total_mass", std::vector<double>{40.0})
      .range(0.1, 1000.0)
      .in("kg")
      .about("mass of the robot");
  d.setting("height", std::vector<double>{0.8})
      .range(0.05, 5.0)
      .in("m")
      .about("height of the centre of mass");
  return d;
}

void CompliantStabiliser::initialize(Setup& setup) {
  from_zmp_ = setup.text("force_source") == "zmp";
  force_per_metre_ = setup.numbers("total_mass")[0] * kGravity / setup.numbers("height")[0];
  if (from_zmp_) {
    zmp_ = setup.read<3>("zmp");
  } else {
    force_ = setup.read<3>("contactForce");
  }
  zmp_reference_ = setup.reference<3>("zmp");
  com_ = setup.modify<3>("com");
  com_velocity_ = setup.modify<3>("comVelocity");
  mass_ = setup.gain("mass");
  damping_ = setup.gain("damping");
  stiffness_ = setup.gain("stiffness");
  max_offset_ = setup.gain("max_offset");
  force_filter_ = setup.gain("force_filter");
}

void CompliantStabiliser::update(const Cycle& cycle, const RobotStates& robot,
                                 const ControlStates& original, ModifiedControlStates& modified) {
  if (from_zmp_) {
    // The ZMP follows the offset. If the offset were not subtracted, each metre of it would count
    // as an additional push of m g / h, and a heavy robot would never return.
    const Eigen::Vector2d distance =
        (robot.view(zmp_) - original.view(zmp_reference_)).head<2>() - offset_;
    const double share = -std::expm1(-cycle.dt / scalar(force_filter_));
    force_estimate_ += share * (force_per_metre_ * distance - force_estimate_);
  } else {
    force_estimate_ = robot.view(force_).head<2>();
  }
  const double limit = scalar(max_offset_);
  axes_.step(gain(mass_), gain(damping_), gain(stiffness_), cycle.dt, force_estimate_, offset_,
             velocity_);
  for (int i = 0; i < 2; ++i) {
    if (std::abs(offset_[i]) > limit) {
      if (said_.pass(cycle.now_ns)) {
        CTRL_MORE_LOG(log(), Warning, "a force of {} N holds axis {} at max_offset, {} m",
                      force_estimate_[i], i, limit);
      }
      offset_[i] = std::copysign(limit, offset_[i]);
      // Compares signs, because the limit may be 0.
      if (std::signbit(offset_[i]) == std::signbit(velocity_[i])) velocity_[i] = 0.0;
    }
  }
  modified[com_].head<2>() += offset_;
  modified[com_velocity_].head<2>() += velocity_;
}

}  // namespace ctrl_more

CTRL_MORE_REGISTER_CONTROLLER(ctrl_more::CompliantStabiliser, "CompliantStabiliser")
