#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "ctrl_more/feedback_controller.hpp"

namespace ctrl_more {

/// Slows joints near the ends of their range.
class JointLimits : public FeedbackController {
 public:
  Description describe() const override;
  void initialize(Setup& setup) override;
  void update(const Cycle& cycle, const RobotStates& robot, const ControlStates& original,
              ModifiedControlStates& modified) override;
  std::string judgeGains(const GainValues& gains) const override;
  void state(Numbers<> values) const override {
    values[0] = slowed_;
    values[1] = nearest_;
  }

 private:
  Read<> position_;
  Modify<> velocity_;
  Gain influence_, safety_, xi_;
  std::vector<double> lower_, upper_;  // [rad]
  int slowed_ = 0;                     // number of slowed joints in this cycle
  double nearest_ = 0.0;               // smallest distance of a joint to an end of its range [rad]
  LogThrottle said_{1'000'000'000};
};

Description JointLimits::describe() const {
  // 170 and 120 degrees, as in the robot's table of joint limits.
  const double wide = 2.967059728390360, narrow = 2.094395102393195;
  const double turns =
      12.5664;  // two turns, more than any wrist has; a number in degrees is larger
  Description d;
  d.type = "JointLimits";
  d.summary = "Bounds the speed of each joint toward the end of its range.";
  d.use =
      "Write measured joint positions into `measuredData` under the key of the setting "
      "`joint_position`; the velocity reference of the same joints is bounded after inverse "
      "kinematics. The settings `lower` and `upper` give the range of each joint.";
  d.when = "Always, with every motion controller whose output is a joint velocity.";
  d.limitations =
      "Bounds each joint alone, so near an end the direction of the motion changes. It never "
      "drives a joint back by itself. The host's own guard remains the final limit.";
  d.law =
      "\\rho < \\rho_i:\\quad \\dot q_{toward} \\le \\xi \\, \\max(0, \\rho - \\rho_s) / "
      "(\\rho_i - \\rho_s)";
  d.source = "Velocity damper near obstacles and limits.";
  d.information =
      "Pushed with constant speed, a joint approaches its safety distance by the factor "
      "1 - xi T / (influence - safety) per cycle and never crosses it while that is >= 0.";
  d.stage = Stage::Joint;
  d.safety = true;
  d.on_switch = SwitchPolicy::Hold;
  d.measured("joint_position")
      .keyFrom("joint_position")
      .in("rad")
      .frameOf("joint")
      .maxAge(0.1)
      .about("measured positions, one per joint");
  d.modifies(ControlContainer::JointSpaceReference, "Velocity")
      .in("rad/s")
      .frameOf("joint")
      .bounded({100.0, kUnlimited, kUnlimited, kUnlimited})
      .whenPaused(StopPolicy::Zero)
      .about("velocity reference, one per joint");
  d.gain("influence", 0.20)
      .range(0.001, 1.0)
      .in("rad")
      .about("distance to an end below which the speed is bounded");
  d.gain("safety", 0.03).range(0.0, 0.5).in("rad").about("distance that is kept");
  d.gain("xi", 1.0).range(0.001, 10.0).in("rad/s").about("bound at the influence distance");
  d.state("slowed").in("1").about("number of joints whose speed is bounded now");
  d.state("nearest").in("rad").about("smallest distance of a joint to an end of its range");
  d.setting("joint_position", "joint_position")
      .about("key of the joint positions in `measuredData`");
  d.setting("lower", std::vector<double>{-wide, -narrow, -wide, -narrow, -wide, -narrow, -wide})
      .range(-turns, turns)
      .in("rad")
      .anySize()
      .about("lower end of each joint");
  d.setting("upper", std::vector<double>{wide, narrow, wide, narrow, wide, narrow, wide})
      .range(-turns, turns)
      .in("rad")
      .anySize()
      .about("upper end of each joint");
  return d;
}

std::string JointLimits::judgeGains(const GainValues& gains) const {
  const double influence = gains.scalar(gains.find("influence"));
  const double safety = gains.scalar(gains.find("safety"));
  if (influence > safety) return "";
  return "influence (" + std::to_string(influence) + " rad) must be larger than safety (" +
         std::to_string(safety) + " rad)";
}

void JointLimits::initialize(Setup& setup) {
  lower_ = setup.numbers("lower");
  upper_ = setup.numbers("upper");
  const int joints = static_cast<int>(lower_.size());
  if (lower_.size() != upper_.size()) {
    throw std::invalid_argument("settings 'lower' and 'upper' must have the same count, got " +
                                std::to_string(lower_.size()) + " and " +
                                std::to_string(upper_.size()));
  }
  for (int i = 0; i < joints; ++i) {
    if (!(lower_[i] < upper_[i])) {
      throw std::invalid_argument("joint " + std::to_string(i) + ": lower must be below upper");
    }
  }
  position_ = setup.read("joint_position", joints);
  velocity_ = setup.modify("Velocity", joints);
  influence_ = setup.gain("influence");
  safety_ = setup.gain("safety");
  xi_ = setup.gain("xi");
}

void JointLimits::update(const Cycle& cycle, const RobotStates& robot, const ControlStates&,
                         ModifiedControlStates& modified) {
  const auto q = robot.view(position_);
  auto qd = modified[velocity_];
  const double influence = scalar(influence_), safety = scalar(safety_), xi = scalar(xi_);
  const auto bound = [&](double distance) {
    return xi * std::max(0.0, distance - safety) / (influence - safety);
  };
  slowed_ = 0;
  nearest_ = kUnlimited;
  int last = 0;
  for (int i = 0; i < static_cast<int>(lower_.size()); ++i) {
    const double above = upper_[i] - q[i];
    const double below = q[i] - lower_[i];
    nearest_ = std::min({nearest_, above, below});
    const bool up = above < influence && qd[i] > bound(above);
    const bool down = below < influence && qd[i] < -bound(below);
    if (up) qd[i] = bound(above);
    if (down) qd[i] = -bound(below);
    if (!up && !down) continue;
    ++slowed_;
    last = i;
  }
  if (slowed_ != 0 && said_.pass(cycle.now_ns)) {
    CTRL_MORE_LOG(log(), Info, "joint {} is slowed, at {} rad in a range of {} to {} rad", last,
                  q[last], lower_[last], upper_[last]);
  }
}

}  // namespace ctrl_more

CTRL_MORE_REGISTER_CONTROLLER(ctrl_more::JointLimits, "JointLimits")
