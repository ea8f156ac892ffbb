// A feedback controller whose law runs in a Python process. It shifts and turns the reference of
// the hand by the received correction, within bounds. Without answers the correction fades out.
#include <cmath>
#include <memory>

#include "coglab_controllers/kinematics/rotation.hpp"
#include "coglab_controllers/remote/bounded.hpp"
#include "coglab_controllers/remote/slot.hpp"
#include "coglab_rt/clock.hpp"
#include "ctrl_more/feedback_controller.hpp"

namespace coglab_controllers {

class RemoteFeedback : public ctrl_more::FeedbackController {
 public:
  ctrl_more::Description describe() const override;
  void initialize(ctrl_more::Setup& setup) override;
  void update(const ctrl_more::Cycle& cycle, const ctrl_more::RobotStates& robot,
              const ctrl_more::ControlStates& original,
              ctrl_more::ModifiedControlStates& modified) override;
  void reset() override {
    const std::int64_t run = question_.run + 1;
    question_ = {};
    question_.run = run;
    question_.running = 1;
    answered_ = false;
    shift_.clear();
    turn_.clear();
  }
  std::string judgeGains(const ctrl_more::GainValues& gains) const override;
  void state(ctrl_more::Numbers<> values) const override {
    values.head<3>() = shift_.at();
    values.segment<3>(3) = turn_.at();
    values[6] = static_cast<double>(question_.late);
  }

 private:
  void take(std::int64_t now_ns) noexcept;
  void ask(const ctrl_more::Cycle& cycle, const ctrl_more::RobotStates& robot,
           const ctrl_more::ControlStates& original) noexcept;

  std::unique_ptr<RemoteSlot> slot_;
  ctrl_more::Read<7> position_, velocity_, torque_, external_, hand_;
  ctrl_more::Read<6> wrench_;
  ctrl_more::Modify<ctrl_more::Pose> pose_;
  ctrl_more::Modify<ctrl_more::Twist> twist_;
  ctrl_more::Gain max_offset_, max_angle_, rate_, turning_rate_, fade_time_, max_age_;
  RemoteQuestion question_{};
  RemoteAnswer answer_{};
  bool answered_ = false;
  BoundedCorrection shift_, turn_;
};

ctrl_more::Description RemoteFeedback::describe() const {
  using ctrl_more::ControlContainer;
  ctrl_more::Description d;
  d.type = "RemoteFeedback";
  d.summary = "Shifts and turns the hand's reference by a correction from a Python process.";
  d.use = "Load it, then run a Python controller in a second terminal: ./coglab controller run.";
  d.when = "To try a control law in Python on the running robot. Write the final law in C++.";
  d.limitations =
      "Python receives the signals below and can correct only the hand's pose. The answer to a "
      "cycle acts one cycle later.";
  d.law = "p' = p + c, R' = \\exp(r) R; \\|\\dot c\\| and \\|c\\| bounded";
  d.source = "The Python process.";
  d.information = "If there is no process or it is late, the correction fades to zero.";
  for (const char* name : {"joint_position", "joint_velocity", "joint_torque", "external_torque"})
    d.measured(name).size(7).in("rad, rad/s or Nm").frameOf("joints").about("passed to Python");
  d.measured("wrench").size(6).in("N, Nm").frameOf("base").about("passed to Python");
  d.estimated("ee").size(7).in("m, 1").frameOf("base").about("pose of the hand, to Python");
  d.modifies(ControlContainer::TaskSpaceReferencePose, "ee")
      .in("m, 1")
      .frameOf("base")
      .bounded({0.21, 1.1, 0.81, 4.1})
      .whenPaused(ctrl_more::StopPolicy::Fade)
      .about("the offset is added");
  d.modifies(ControlContainer::TaskSpaceReferenceVel, "ee")
      .in("m/s, rad/s")
      .frameOf("base")
      .about("the velocity of the offset is added");
  d.gain("max_offset", 0.05).range(0.0, 0.2).in("m").about("largest shift");
  d.gain("max_angle", 0.2).range(0.0, 0.8).in("rad").about("largest turn");
  d.gain("rate", 0.2).range(0.001, 1.0).in("m/s").about("largest speed of the shift");
  d.gain("turning_rate", 0.8).range(0.001, 4.0).in("rad/s").about("largest speed of the turn");
  d.gain("fade_time", 0.5)
      .range(0.02, 10.0)
      .in("s")
      .about("without answers a correction fades to zero within this time");
  d.gain("max_age", 0.03)
      .range(0.001, 0.5)
      .in("s")
      .about("largest age of an answer; after it the correction fades");
  d.addStates({"offset_x", "offset_y", "offset_z"}, "m", "shift that is applied");
  d.addStates({"turn_x", "turn_y", "turn_z"}, "rad", "turn that is applied");
  d.state("late").in("1").about("cycles without an answer in time");
  return d;
}

std::string RemoteFeedback::judgeGains(const ctrl_more::GainValues& gains) const {
  const auto value = [&gains](const char* name) { return gains.scalar(gains.find(name)); };
  // Otherwise fading within fade_time would exceed the rates.
  if (value("max_offset") > value("rate") * value("fade_time"))
    return "max_offset is larger than rate * fade_time; make fade_time or rate larger";
  if (value("max_angle") > value("turning_rate") * value("fade_time"))
    return "max_angle is larger than turning_rate * fade_time; make one of them larger";
  return "";
}

void RemoteFeedback::initialize(ctrl_more::Setup& setup) {
  position_ = setup.read<7>("joint_position");
  velocity_ = setup.read<7>("joint_velocity");
  torque_ = setup.read<7>("joint_torque");
  external_ = setup.read<7>("external_torque");
  wrench_ = setup.read<6>("wrench");
  hand_ = setup.read<7>("ee");
  pose_ = setup.modify<ctrl_more::Pose>("taskSpaceReferencePose/ee");
  twist_ = setup.modify<ctrl_more::Twist>("taskSpaceReferenceVel/ee");
  max_offset_ = setup.gain("max_offset");
  max_angle_ = setup.gain("max_angle");
  rate_ = setup.gain("rate");
  turning_rate_ = setup.gain("turning_rate");
  fade_time_ = setup.gain("fade_time");
  max_age_ = setup.gain("max_age");
  slot_ = std::make_unique<RemoteSlot>(getName(), RemoteKind::Feedback);
}

/// Uses the newest answer if it belongs to this run and is valid.
void RemoteFeedback::take(std::int64_t now_ns) noexcept {
  RemoteAnswer answer;
  if (!slot_->read(answer) || answer.run != question_.run) return;
  if (answer.kind == static_cast<std::int64_t>(RemoteAnswerKind::GiveUp)) {
    answered_ = false;  // the correction fades at once
    return;
  }
  bool usable = answer.kind == static_cast<std::int64_t>(RemoteAnswerKind::Correction) &&
                answer.stamp_ns <= now_ns && !(answered_ && answer.stamp_ns < answer_.stamp_ns);
  for (int i = 0; i < 6; ++i)
    usable = usable && std::isfinite(answer.values[i]) && std::abs(answer.values[i]) < 1e3;
  if (!usable) {
    ++question_.refused;
    return;
  }
  answer_ = answer;
  answered_ = true;
}

void RemoteFeedback::ask(const ctrl_more::Cycle& cycle, const ctrl_more::RobotStates& robot,
                         const ctrl_more::ControlStates& original) noexcept {
  const auto write = [](double* place, const auto& values) {
    for (int i = 0; i < values.size(); ++i) place[i] = values[i];
  };
  question_.stamp_ns = cycle.now_ns;
  question_.written_ns = coglab_rt::steadyNow();
  ++question_.cycle;
  question_.dt = cycle.dt;
  write(question_.joints, robot.view(position_));
  write(question_.joint_velocity, robot.view(velocity_));
  write(question_.joint_torque, robot.view(torque_));
  write(question_.external_torque, robot.view(external_));
  write(question_.wrench, robot.view(wrench_));
  write(question_.hand, robot.view(hand_));
  write(question_.reference_pose, original.view(pose_));
  write(question_.reference_twist, original.view(twist_));
  slot_->ask(question_);
}

void RemoteFeedback::update(const ctrl_more::Cycle& cycle, const ctrl_more::RobotStates& robot,
                            const ctrl_more::ControlStates& original,
                            ctrl_more::ModifiedControlStates& modified) {
  take(cycle.now_ns);
  const double age = 1e-9 * static_cast<double>(cycle.now_ns - answer_.stamp_ns);
  const bool fresh = answered_ && slot_->connected() && age <= scalar(max_age_);
  if (answered_ && age > 2.5 * cycle.dt) ++question_.late;
  ask(cycle, robot, original);

  const Eigen::Vector3d shift = shift_.at(), turn = turn_.at();
  shift_.setBounds(scalar(max_offset_), scalar(rate_), scalar(fade_time_));
  turn_.setBounds(scalar(max_angle_), scalar(turning_rate_), scalar(fade_time_));
  if (fresh) {
    shift_.follow(Eigen::Map<const Eigen::Vector3d>(answer_.values), cycle.dt);
    turn_.follow(Eigen::Map<const Eigen::Vector3d>(answer_.values + 3), cycle.dt);
  } else {
    shift_.fade(cycle.dt);
    turn_.fade(cycle.dt);
  }
  const Eigen::Vector3d moved = shift_.at() - shift, turned = turn_.at() - turn;
  if (shift_.at().isZero(0.0) && turn_.at().isZero(0.0) && moved.isZero(0.0) && turned.isZero(0.0))
    return;  // the references keep every bit
  auto pose = modified[pose_];
  pose.head<3>() += shift_.at();
  const Quaternion before(pose.tail<4>().data());
  pose.tail<4>() = (expRotation(turn_.at()) * before).normalized().coeffs();
  Eigen::Matrix<double, 6, 1> speed;
  speed << moved / cycle.dt, turned / cycle.dt;
  modified[twist_] += speed;
}

}  // namespace coglab_controllers

CTRL_MORE_REGISTER_CONTROLLER(coglab_controllers::RemoteFeedback, "RemoteFeedback")
