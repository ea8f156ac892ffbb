#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "ctrl_more/prototypes.hpp"

namespace ctrl_more {

/// Stabilises the divergent component of motion by the ZMP, or the ZMP by the centre of mass. See
/// doc/controllers/ZmpDcm.md.
class ZmpDcm : public FeedbackController {
 public:
  Description describe() const override;
  void initialize(Setup& setup) override;
  void update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
              ModifiedControlStates& modified) override;
  void reset() override { offset_.setZero(); }
  std::string judgeGains(const GainValues& gains) const override;
  std::vector<std::pair<std::string, double>> state() const override {
    return {{"offset_x", offset_.x()}, {"offset_y", offset_.y()}};
  }

 private:
  void followDcm(const RobotStates& robot, const ControlStates& original,
                 ModifiedControlStates& modified);
  void followZmp(double dt, const RobotStates& robot, const ControlStates& original,
                 ModifiedControlStates& modified);

  static constexpr double kGravity = 9.80665;  // [m/s^2]
  bool dcm_ = true;
  double omega_ = 0.0;  // sqrt(g / h) [1/s]
  RobotSignal com_, zmp_;
  ControlSignal com_reference_, com_velocity_reference_, zmp_reference_;
  ModifySignal zmp_out_, com_out_;
  Gain k_, support_, kc_, ki_, max_offset_;
  Eigen::Vector2d offset_ = Eigen::Vector2d::Zero();  // of the centre of mass, zmp_ip mode [m]
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
      "only for 0 < k < 2 w / (exp(w T) - 1). In mode `zmp_ip` for ki T (1 + kc) < 2.";
  d.law =
      "\\omega = \\sqrt{g/h},\\ \\xi = c + \\dot c/\\omega,\\ p' = p + (1 + k/\\omega)(\\xi - "
      "\\xi_{ref}) \\text{ in the support box};\\quad \\text{zmp\\_ip: } \\Delta p = -k_c x,\\ "
      "\\dot x = -k_i (p_{meas} - p_{ref} - \\Delta p),\\ c' = c + x";
  d.source =
      "Feedback of the divergent component of motion of the linear inverted pendulum; two coupled "
      "loops of ZMP and centre of mass for mode zmp_ip.";
  d.publishes = "`offset_x`, `offset_y`: offset of the centre of mass in mode zmp_ip [m].";
  d.estimated("com").size(6).in("m, m/s").frameOf("world").maxAge(0.05).ifAsked().about(
      "position and velocity of the centre of mass (mode dcm)");
  d.estimated("zmp").size(3).in("m").frameOf("world").maxAge(0.05).ifAsked().about(
      "estimated ZMP (mode zmp_ip)");
  d.reads(ControlContainer::CentreOfMass, "comVelocity").in("m/s").frameOf("world").about(
      "velocity reference of the centre of mass (mode dcm)");
  d.modifies(ControlContainer::Zmp, "zmp").in("m").frameOf("world")
      .bounded({2.0, kUnlimited, kUnlimited, kUnlimited}).whenPaused(StopPolicy::Fade)
      .about("ZMP reference, x and y");
  d.modifies(ControlContainer::CentreOfMass, "com").in("m").frameOf("world")
      .bounded({0.5, kUnlimited, kUnlimited, kUnlimited}).whenPaused(StopPolicy::Hold)
      .about("reference of the centre of mass, x and y; changed in mode zmp_ip only");
  d.gain("k", 4.0).range(0.0, 1000.0).in("1/s").about("decay rate of the DCM error (mode dcm)");
  d.gain("support_box", 0).vector(4, 0.1).range(0.0, 1.0).in("m").about(
      "how far p' may leave the ZMP reference: back, front, right, left (mode dcm)");
  d.gain("kc", 0).vector(2, 1.0).range(0.0, 20.0).in("1").about(
      "virtual spring from the offset to the ZMP reference, x and y (mode zmp_ip)");
  d.gain("ki", 0).vector(2, 3.5).range(0.0, 50.0).in("1/s").about(
      "integral action of the ZMP error, x and y (mode zmp_ip)");
  d.gain("max_offset", 0.05).range(0.0, 0.3).in("m").about("bound of both corrections (zmp_ip)");
  d.setting("mode", "dcm").oneOf({"dcm", "zmp_ip"}).about("which law");
  d.setting("height", std::vector<double>{0.8}).range(0.05, 5.0).in("m").about(
      "height of the centre of mass above the ground");
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
    com_ = setup.robot("com");
  } else {
    zmp_ = setup.robot("zmp");
  }
  com_velocity_reference_ = setup.control("comVelocity");
  zmp_out_ = setup.modify("zmp");
  com_out_ = setup.modify("com");
  zmp_reference_ = zmp_out_.signal();
  com_reference_ = com_out_.signal();
  k_ = setup.gain("k");
  support_ = setup.gain("support_box");
  kc_ = setup.gain("kc");
  ki_ = setup.gain("ki");
  max_offset_ = setup.gain("max_offset");
}

void ZmpDcm::update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
                    ModifiedControlStates& modified) {
  if (dcm_) {
    followDcm(robot, original, modified);
  } else {
    followZmp(cycle.dt, robot, original, modified);
  }
}

void ZmpDcm::followDcm(const RobotStates& robot, const ControlStates& original,
                       ModifiedControlStates& modified) {
  const auto com = robot.view<6>(com_);
  const Eigen::Vector2d dcm = com.head<2>() + com.segment<2>(3) / omega_;
  const Eigen::Vector2d reference =
      original.view<3>(com_reference_).head<2>() +
      original.view<3>(com_velocity_reference_).head<2>() / omega_;
  const Eigen::Vector2d wanted = (1.0 + scalar(k_) / omega_) * (dcm - reference);
  const auto box = gain(support_);
  auto zmp = modified.at<3>(zmp_out_);
  zmp[0] += std::clamp(wanted[0], -box[0], box[1]);
  zmp[1] += std::clamp(wanted[1], -box[2], box[3]);
}

void ZmpDcm::followZmp(double dt, const RobotStates& robot, const ControlStates& original,
                       ModifiedControlStates& modified) {
  const double limit = scalar(max_offset_);
  auto zmp = modified.at<3>(zmp_out_);
  auto com = modified.at<3>(com_out_);
  for (int i = 0; i < 2; ++i) {
    const double shift = std::clamp(-gain(kc_)[i] * offset_[i], -limit, limit);
    const double error =
        robot.view<3>(zmp_)[i] - original.view<3>(zmp_reference_)[i] - shift;
    offset_[i] = std::clamp(offset_[i] - dt * gain(ki_)[i] * error, -limit, limit);
    zmp[i] += shift;
    com[i] += offset_[i];
  }
}

}  // namespace ctrl_more

CTRL_MORE_REGISTER_CONTROLLER(ctrl_more::ZmpDcm, "ZmpDcm")
