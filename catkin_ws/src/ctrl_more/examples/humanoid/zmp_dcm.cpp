#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "ctrl_more/feedback_controller.hpp"

namespace ctrl_more {

/// Stabilises the divergent component of motion with the ZMP, or the ZMP with the centre of mass.
/// See the page beside this file.
class ZmpDcm : public FeedbackController {
 public:
  Description describe() const override;
  void initialize(Setup& setup) override;
  void update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
              ModifiedControlStates& modified) override;
  void reset() override {
    offset_.setZero();
    shift_.setZero();
    apart_.setZero();
  }
  std::string judgeGains(const GainValues& gains) const override;
  void state(Numbers<> values) const override {
    values.head<2>() = offset_;
    values.tail<2>() = shift_;
  }

 private:
  void followDcm(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
                 ModifiedControlStates& modified);
  void followZmp(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
                 ModifiedControlStates& modified);

  static constexpr double kGravity = 9.80665;  // [m/s^2]
  bool dcm_ = true;
  double omega_ = 0.0;  // sqrt(g / h) [1/s]
  Read<6> com_;
  Read<3> zmp_;
  Reference<3> com_velocity_reference_;
  Modify<3> zmp_out_, com_out_;
  Gain k_, support_, kc_, ki_, max_offset_, zmp_filter_;
  Eigen::Vector2d offset_ = Eigen::Vector2d::Zero();  // centre of mass, zmp_ip mode [m]
  Eigen::Vector2d shift_ = Eigen::Vector2d::Zero();   // shift of the ZMP reference [m]
  Eigen::Vector2d apart_ = Eigen::Vector2d::Zero();   // filtered measured ZMP minus reference [m]
  LogThrottle said_{1'000'000'000};
};

Description ZmpDcm::describe() const {
  Description d;
  d.type = "ZmpDcm";
  d.summary = "Balances an inverted pendulum: DCM feedback on the ZMP, or ZMP feedback on the CoM.";
  d.use =
      "Mode `dcm`: write estimated position and velocity of the centre of mass (6) into "
      "`estimatedData` `com`, and the references com, comVelocity and zmp; the ZMP reference is "
      "corrected. Mode `zmp_ip`: write the estimated ZMP (3) into `estimatedData` `zmp`; "
      "references zmp and com are corrected.";
  d.when =
      "Mode `dcm` where ankle torque or whole-body control can place the ZMP; mode `zmp_ip` on "
      "position-controlled robots. Not both modes on one robot at once.";
  d.limitations =
      "Horizontal directions, constant height. In mode `dcm` with a held ZMP the loop is stable "
      "only for 0 < k < 2 w / (exp(w T) - 1). In mode `zmp_ip` for ki T (1 + kc) < 2, and with a "
      "`zmp_filter` longer than 1 / (w sqrt(kc)): the measured ZMP also holds what accelerating "
      "the "
      "centre of mass takes, and unfiltered that drives the offset the wrong way.";
  d.law =
      "\\omega = \\sqrt{g/h},\\ \\xi = c + \\dot c/\\omega,\\ p' = p + (1 + k/\\omega)(\\xi - "
      "\\xi_{ref}) \\text{ in the support box};\\quad \\text{zmp\\_ip: } \\Delta p = -k_c x,\\ "
      "\\dot x = -k_i (e - \\Delta p),\\ \\tau \\dot e + e = p_{meas} - p_{ref},\\ c' = c + x";
  d.source =
      "Feedback of the divergent component of motion of the linear inverted pendulum; two coupled "
      "loops of ZMP and centre of mass for mode zmp_ip.";
  d.estimated("com").size(6).in("m, m/s").frameOf("world").maxAge(0.05).ifAsked().about(
      "position and velocity of the centre of mass (mode dcm)");
  d.estimated("zmp").size(3).in("m").frameOf("world").maxAge(0.05).ifAsked().about(
      "estimated ZMP (mode zmp_ip)");
  d.reads(ControlContainer::CentreOfMass, "comVelocity")
      .in("m/s")
      .frameOf("world")
      .about("velocity reference of the centre of mass (mode dcm)");
  d.modifies(ControlContainer::Zmp, "zmp")
      .in("m")
      .frameOf("world")
      .bounded({2.0, kUnlimited, kUnlimited, kUnlimited})
      .whenPaused(StopPolicy::Fade)
      .about("ZMP reference, x and y");
  d.modifies(ControlContainer::CentreOfMass, "com")
      .in("m")
      .frameOf("world")
      .bounded({0.5, kUnlimited, kUnlimited, kUnlimited})
      .whenPaused(StopPolicy::Hold)
      .about("reference of the centre of mass, x and y; changed in mode zmp_ip only");
  d.gain("k", 4.0).range(0.0, 1000.0).in("1/s").about("decay rate of the DCM error (mode dcm)");
  d.gain("support_box", 0)
      .vector(4, 0.1)
      .range(0.0, 1.0)
      .in("m")
      .about("how far p' may leave the ZMP reference: back, front, right, left (mode dcm)");
  d.gain("kc", 0).vector(2, 1.0).range(0.0, 20.0).in("1").about(
      "virtual spring from the offset to the ZMP reference, x and y (mode zmp_ip)");
  d.gain("ki", 0).vector(2, 3.5).range(0.0, 50.0).in("1/s").about(
      "integral action of the ZMP error, x and y (mode zmp_ip)");
  d.gain("max_offset", 0.05).range(0.0, 0.3).in("m").about("bound of both corrections (zmp_ip)");
  d.gain("zmp_filter", 0.4)
      .range(0.0, 5.0)
      .in("s")
      .about("time constant tau of the measured ZMP (zmp_ip)");
  d.addStates({"offset_x", "offset_y"}, "m", "offset of the centre of mass (mode zmp_ip)");
  d.addStates({"shift_x", "shift_y"}, "m", "correction of the ZMP reference");
  d.setting("mode", "dcm").oneOf({"dcm", "zmp_ip"}).about("which law");
  d.setting("height", std::vector<double>{0.8})
      .range(0.05, 5.0)
      .in("m")
      .about("height of the centre of mass above the ground");
  return d;
}

std::string ZmpDcm::judgeGains(const GainValues& gains) const {
  const auto box = gains[gains.find("support_box")];
  return box.maxCoeff() > 0.0 ? "" : "support_box must have at least one side > 0";
}

void ZmpDcm::initialize(Setup& setup) {
  dcm_ = setup.text("mode") == "dcm";
  omega_ = std::sqrt(kGravity / setup.numbers("height")[0]);
  if (dcm_) {
    com_ = setup.read<6>("com");
  } else {
    zmp_ = setup.read<3>("zmp");
  }
  com_velocity_reference_ = setup.reference<3>("comVelocity");
  zmp_out_ = setup.modify<3>("zmp");
  com_out_ = setup.modify<3>("com");
  k_ = setup.gain("k");
  support_ = setup.gain("support_box");
  kc_ = setup.gain("kc");
  ki_ = setup.gain("ki");
  max_offset_ = setup.gain("max_offset");
  zmp_filter_ = setup.gain("zmp_filter");
}

void ZmpDcm::update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
                    ModifiedControlStates& modified) {
  if (dcm_) {
    followDcm(cycle, robot, original, modified);
  } else {
    followZmp(cycle, robot, original, modified);
  }
}

void ZmpDcm::followDcm(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
                       ModifiedControlStates& modified) {
  const auto com = robot.view(com_);
  const Eigen::Vector2d dcm = com.head<2>() + com.segment<2>(3) / omega_;
  const Eigen::Vector2d reference =
      original.view(com_out_).head<2>() + original.view(com_velocity_reference_).head<2>() / omega_;
  const Eigen::Vector2d wanted = (1.0 + scalar(k_) / omega_) * (dcm - reference);
  const auto box = gain(support_);
  shift_ << std::clamp(wanted[0], -box[0], box[1]), std::clamp(wanted[1], -box[2], box[3]);
  modified[zmp_out_].head<2>() += shift_;
  if (shift_ != wanted && said_.pass(cycle.now_ns)) {
    CTRL_MORE_LOG(log(), Warning, "ZMP is at the edge of the support box: {} {} m are wanted",
                  wanted[0], wanted[1]);
  }
}

void ZmpDcm::followZmp(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
                       ModifiedControlStates& modified) {
  const double limit = scalar(max_offset_);
  const double share = -std::expm1(-cycle.dt / scalar(zmp_filter_));
  apart_ += share * ((robot.view(zmp_) - original.view(zmp_out_)).head<2>() - apart_);
  auto zmp = modified[zmp_out_];
  auto com = modified[com_out_];
  for (int i = 0; i < 2; ++i) {
    shift_[i] = std::clamp(-gain(kc_)[i] * offset_[i], -limit, limit);
    const double wanted = offset_[i] - cycle.dt * gain(ki_)[i] * (apart_[i] - shift_[i]);
    offset_[i] = std::clamp(wanted, -limit, limit);
    zmp[i] += shift_[i];
    com[i] += offset_[i];
    if (offset_[i] != wanted && said_.pass(cycle.now_ns)) {
      CTRL_MORE_LOG(log(), Warning, "offset of axis {} is held at max_offset, {} m", i, limit);
    }
  }
}

}  // namespace ctrl_more

CTRL_MORE_REGISTER_CONTROLLER(ctrl_more::ZmpDcm, "ZmpDcm")
