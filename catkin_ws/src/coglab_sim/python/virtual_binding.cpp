/// Python module coglab_sim._virtual: the whole robot (cell, bridge, controller manager) in virtual
/// time.
#include "coglab_sim/virtual_robot.hpp"
#include "lwr_fri_bridge/requests/events.hpp"
#include "py_cell.hpp"
#include "python_motion.hpp"

namespace py = pybind11;
using namespace coglab_sim;
using namespace coglab_sim::python;
using coglab_controllers::Answer;
using coglab_controllers::DmpRequest;

namespace {

/// The robot with the code of the newest answer, which is not in the returned tuples.
class Robot : public LockstepRobot {
 public:
  using LockstepRobot::LockstepRobot;
  std::uint16_t reason_code = 0;
  std::map<std::string, const PythonMotion*> python_motions;  ///< by id; the manager owns them

  py::tuple keep(const Answer& answer) {
    reason_code = answer.number();
    return py::make_tuple(answer.success, answer.message);
  }
};

py::dict dictOf(const coglab_controllers::CancelAnswer& answer) {
  py::dict result;
  result["success"] = answer.success;
  result["was_running"] = answer.was_running;
  result["reason_code"] = answer.number();
  result["message"] = answer.message;
  return result;
}

py::list endsOf(coglab_controllers::PtpController& ptp) {
  py::list ends;
  coglab_controllers::EndedMotion end;
  while (ptp.readEnd(end)) {
    py::dict entry;
    entry["ptp_id"] = end.id;
    entry["executed"] = end.executed;
    entry["reason_code"] = end.reason.number();
    entry["reason"] = end.reason.str();
    ends.append(entry);
  }
  return ends;
}

/// Loads, activates and opens a stream of velocities.
py::tuple openStream(Robot& robot, const std::string& id) {
  const bool twist = id == "twist_stream";
  if (!twist && id != "joint_velocity_stream") {
    return robot.keep(Answer::refusal(
        coglab_rt::ReasonCode::UnknownName,
        "'" + id + "' is no stream; there are twist_stream and joint_velocity_stream"));
  }
  Answer answer;
  if (robot.manager().motion(id) == nullptr)
    answer = robot.load(id, twist ? "coglab/TwistStream" : "coglab/JointVelocityStream");
  if (answer.success && robot.manager().report().active.str() != id) {
    std::string type;
    answer = robot.manager().switchTo(id, type);
  }
  if (answer.success) answer = robot.stream(id).open();
  return robot.keep(answer);
}

py::tuple addMotion(Robot& robot, const std::string& id, const py::object& steps) {
  auto motion = std::make_unique<PythonMotion>(steps);
  const PythonMotion* const kept = motion.get();
  const Answer answer = robot.add(id, "python/Motion", std::move(motion));
  if (answer.success) robot.python_motions[id] = kept;
  return robot.keep(answer);
}

py::tuple startMotion(Robot& robot, const std::string& id, const py::dict& arguments, bool queue) {
  coglab_controllers::CustomMotionController& motion = robot.motion(id);
  coglab_controllers::MotionRequestByName request;
  request.queue = queue;
  for (const auto& [name, value] : arguments) {
    request.names.push_back(name.cast<std::string>());
    request.values.push_back(value.cast<double>());
  }
  if (robot.manager().report().active.str() != id) {
    std::string type;
    const Answer answer = robot.manager().switchTo(id, type);
    if (!answer.success) return py::make_tuple(false, answer.message, -1);
  }
  const coglab_controllers::MotionAnswer answer = motion.startMotion(request);
  robot.reason_code = answer.number();
  return py::make_tuple(answer.success, answer.message, answer.id);
}

py::dict motionProgress(Robot& robot, const std::string& id) {
  coglab_controllers::MotionProgress progress;
  robot.motion(id).readProgress(progress);
  py::dict result;
  result["number"] = progress.id;
  result["state"] = std::string(nameOf(progress.state));
  result["reason"] = progress.reason.str();
  result["reason_code"] = progress.reason.number();
  result["time"] = progress.time;
  result["queued"] = progress.queued;
  const auto found = robot.python_motions.find(id);
  result["error"] = found == robot.python_motions.end() ? "" : found->second->error();
  return result;
}

Eigen::Vector4d noOrientation() { return Eigen::Vector4d::Zero(); }

DmpRequest requestOf(const std::string& primitive, double ratio, const Vector3d& offset,
                     bool orientation_control, const Eigen::Vector4d& orientation,
                     const std::string& goal_frame) {
  DmpRequest request;
  request.primitive_id = primitive;
  request.dmp_ratio = ratio;
  request.goal_offset = offset;
  request.orientation_control = orientation_control;
  request.target_orientation = orientation;
  request.goal_frame = goal_frame;
  return request;
}

py::dict reportOf(Robot& robot) {
  const auto report = robot.manager().report();
  const auto& sample = report.robot;
  py::dict result;
  result["active"] = std::string(report.active.c_str());
  result["state"] = std::string(nameOf(report.state));
  result["motion"] = std::string(nameOf(report.motion));
  result["reason"] = std::string(report.reason.c_str());
  result["reason_code"] = report.reason.number();
  result["standing"] = report.standing;
  result["fault"] = report.fault;
  result["time_scale"] = report.time_scale;
  result["velocity"] = Vector7(report.velocity);
  result["motion_allowed"] = sample.block == coglab_rt::MotionBlock::None;
  result["blocked_by"] = std::string(coglab_rt::describe(sample.block));
  result["blocked_code"] = static_cast<std::uint16_t>(coglab_rt::codeOf(sample.block));
  result["position"] = Vector7(sample.position);
  result["measured_velocity"] = Vector7(sample.velocity);
  result["commanded_position"] = Vector7(sample.commanded_position);
  result["commanded_velocity"] = Vector7(sample.commanded_velocity);
  result["commanded_acceleration"] = Vector7(sample.commanded_acceleration);
  result["fri_period"] = sample.cycle_time;
  result["torque"] = Vector7(sample.torque);
  result["external_torque"] = Vector7(sample.external_torque);
  result["cycles"] = report.cycles;
  return result;
}

py::dict limitsOf(Robot& robot) {
  const LimitWatch& limits = robot.limits();
  py::dict result;
  result["commanded"] = limits.outside().commanded;
  result["measured"] = limits.outside().measured;
  result["over_command"] = limits.outside().over_command;
  result["peak_share"] = limits.peakShare();
  result["measured_share"] = limits.measuredShare();
  return result;
}

py::dict feedbackOf(Robot& robot) {
  py::list controllers;
  for (const ctrl_more::ControllerStatus& status : robot.manager().feedback().statusAll()) {
    py::dict entry;
    entry["name"] = status.name;
    entry["enabled"] = status.enabled;
    entry["activity"] = std::string(ctrl_more::nameOf(status.activity));
    controllers.append(entry);
  }
  py::dict result;
  result["profile"] = robot.manager().profile();
  result["controllers"] = controllers;
  return result;
}

py::dict debugOf(const coglab_controllers::IkDebugRecord& record) {
  py::dict result;
  result["time"] = 1e-9 * static_cast<double>(record.stamp_ns);
  result["goal"] =
      py::make_tuple(Vector3d(record.goal), Eigen::Vector4d(record.goal_orientation.coeffs()));
  result["set_point"] = py::make_tuple(Vector3d(record.set_point.position),
                                       Eigen::Vector4d(record.set_point.orientation.coeffs()));
  result["measured"] = py::make_tuple(Vector3d(record.measured.position),
                                      Eigen::Vector4d(record.measured.orientation.coeffs()));
  return result;
}

}  // namespace

PYBIND11_MODULE(_virtual, m) {
  m.doc() =
      "Cell, bridge and controller manager in one thread and in virtual time. SI units, "
      "quaternions x y z w.";
  py::module_::import("coglab_sim._cell");  // registers the type of LockstepRobot.cell

  py::class_<coglab_controllers::CancelOrder>(m, "CancelOrder", "A cancel in progress.");

  py::class_<Robot>(
      m, "LockstepRobot",
      "Time advances only by tick() and advance(); requests take effect between two ticks.")
      .def(py::init([](const std::string& urdf, const std::string& limits_file,
                       const py::dict& cell, const std::string& manager) {
             LockstepRobotConfig config;
             config.cell = configFrom(urdf, cell);
             config.limits_file = limits_file;
             config.manager_parameters = manager;
             return std::make_unique<Robot>(config);
           }),
           py::arg("urdf"), py::arg("limits_file"), py::arg("cell") = py::dict(),
           py::arg("manager") = "",
           "cell: parameters of the cell as in coglab_sim._cell.parameters(); manager: YAML "
           "as below /controller_manager.")
      .def("tick", &Robot::tick, "One FRI period.")
      .def(
          "advance",
          [](Robot& robot, double seconds) {
            const auto ticks = std::llround(seconds / robot.cell().period());
            for (long long i = 0; i < ticks; ++i) robot.tick();
          },
          py::arg("seconds"), "Advances this number of simulated seconds.")
      .def_property_readonly("now", &Robot::now, "s")
      .def_property_readonly(
          "cell", [](Robot& robot) { return std::make_unique<PyCell>(robot.cell()); },
          py::keep_alive<0, 1>(), "The coglab_sim._cell.Cell inside; do not call its step().")
      .def_property("frozen", &Robot::frozen, &Robot::setFrozen,
                    "True stops bridge and manager, like SIGSTOP; the cell continues.")
      .def("report", &reportOf, "The control cycle's newest report.")
      .def_property_readonly(
          "connected", [](const Robot& robot) { return robot.report().robot.cycle_time > 0.0; },
          "Whether the arm's interface has an FRI session: the report then has an fri_period > 0.")
      .def(
          "limits", &limitsOf,
          "Numbers of ticks outside a limit: {commanded, measured, over_command (true joints above "
          "the lower limit of commands)}, and the largest speeds so far as share of their limits: "
          "{peak_share (commands), measured_share (true joints)}.")

      .def(
          "submit",
          [](Robot& robot, const std::string& event) { return robot.bridge().submit(event); },
          "An event of ros_events; returns a ticket for outcome().")
      .def(
          "outcome",
          [](Robot& robot, std::uint32_t ticket) -> py::object {
            const auto outcome = robot.bridge().outcome(ticket);
            if (outcome.code == lwr_fri_bridge::OutcomeCode::Pending) return py::none();
            return py::make_tuple(outcome.success(), describe(outcome),
                                  static_cast<std::uint16_t>(codeOf(outcome.code)));
          },
          py::arg("ticket"), "(success, message, reason code), or None while it is not finished.")

      .def(
          "load_controller",
          [](Robot& robot, const std::string& id, const std::string& type) {
            return robot.keep(robot.load(id, type));
          },
          py::arg("id"), py::arg("type"),
          "coglab/DmpController or coglab/PtpController; (success, message).")
      .def(
          "switch_controller",
          [](Robot& robot, const std::string& id) {
            std::string type;
            return robot.keep(robot.manager().switchTo(id, type));
          },
          py::arg("id"))
      .def(
          "apply_profile",
          [](Robot& robot, const std::string& profile) {
            return robot.keep(robot.manager().applyProfile(profile));
          },
          py::arg("profile"),
          "Enables exactly the feedback controllers of that profile; (success, message).")
      .def("feedback_status", &feedbackOf,
           "{profile, controllers: [{name, enabled, activity}]}, as the topic feedback/status.")
      .def("speed_scale",
           [](Robot& robot, double scale) {
             return robot.keep(robot.manager().setSpeedScale(scale));
           })

      .def_readonly("reason_code", &Robot::reason_code,
                    "ReasonCode of the newest answer of load_controller, switch_controller, "
                    "apply_profile, speed_scale, add_ptp, open_stream, stream_twist, "
                    "stream_joint_velocity, load_dmps, execute_dmp or switch_dmp.")
      .def(
          "ask_cancel",
          [](Robot& robot, const std::string& id, const std::string& why) {
            return robot.manager().askCancel(id, why);
          },
          py::arg("id"), py::arg("why") = "",
          "Ends the motion of a controller and what waits behind it with the next tick; returns "
          "the order for cancel_outcome().")
      .def(
          "cancel_outcome",
          [](Robot& robot, const coglab_controllers::CancelOrder& order,
             double waited) -> py::object {
            coglab_controllers::CancelAnswer answer;
            if (robot.manager().cancelEnded(order, answer)) return dictOf(answer);
            if (waited <= 0.0) return py::none();
            return dictOf(robot.manager().cancelUnfinished(order, waited));
          },
          py::arg("order"), py::arg("waited") = 0.0,
          "{success, was_running, reason_code, message} once the arm stands, else None; with "
          "`waited` > 0 (s) the refusal for an arm that does not stand after so long.")

      .def(
          "add_ptp",
          [](Robot& robot, const std::vector<double>& position, const std::vector<double>& max_vel,
             const std::vector<double>& max_acc) {
            const auto answer = robot.ptp().add({position, max_vel, max_acc});
            robot.reason_code = static_cast<std::uint16_t>(answer.code);
            return py::make_tuple(answer.status, answer.id, answer.message);
          },
          py::arg("position"), py::arg("max_vel") = std::vector<double>(),
          py::arg("max_acc") = std::vector<double>(),
          "(status, ptp_id, message) as Table 5 has them: STARTED 0, QUEUED 1, REJECTED 2.")
      .def(
          "finished_ptps",
          [](Robot& robot) {
            std::vector<std::pair<int, bool>> ends;
            coglab_controllers::EndedMotion end;
            while (robot.ptp().readEnd(end)) ends.emplace_back(end.id, end.executed);
            return ends;
          },
          "[(ptp_id, executed)] of the motions that ended since the last call.")

      .def(
          "ptp_ends", [](Robot& robot) { return endsOf(robot.ptp()); },
          "[{ptp_id, executed, reason_code, reason}] of the same motions, instead of "
          "finished_ptps().")

      .def_property_readonly(
          "feedback",
          [](Robot& robot) -> ctrl_more::FeedbackControllersManager& {
            py::module_::import("ctrl_more");  // registers the type, and loads Python controllers
            return robot.manager().feedback();
          },
          py::return_value_policy::reference_internal,
          "The robot's own ctrl_more.FeedbackControllersManager: load, order, pause and tune "
          "controllers here, C++ and Python ones. The cycle runs it.")

      .def("post_signal", &Robot::postSignal, py::arg("topic"), py::arg("numbers"),
           py::arg("age") = 0.0, py::arg("frame") = "",
           py::arg("joints") = std::vector<std::string>(),
           "Posts a message of a topic of the file of signals (parameter signals_file), as if it "
           "arrived now. numbers: values of each field by its name; age: s since the measurement; "
           "frame: frame_id; joints: names of a JointState. Returns why a row refuses it, '' if "
           "none does. The palm's IMU and wrench sensor post coglab_sim/palm_imu and "
           "coglab_sim/palm_wrench in each tick. ValueError: no row has the topic, or its type no "
           "such field.")
      .def(
          "robot_signal",
          [](Robot& robot, const std::string& key) -> py::object {
            const ctrl_more::RobotStates& states = robot.manager().feedbackStage().robot();
            for (const auto source :
                 {ctrl_more::RobotSource::Measured, ctrl_more::RobotSource::Estimated}) {
              const ctrl_more::RobotSignal signal = states.find(source, key);
              if (!signal.valid()) continue;
              if (states.stamp(signal) == ctrl_more::kNeverWritten) return py::none();
              return py::cast(Eigen::VectorXd(states.view(signal)));
            }
            throw std::invalid_argument("there is no robot signal '" + key + "'");
          },
          py::arg("key"),
          "Numbers of a robot signal as feedback controllers read it; None while it is absent.")
      .def_property_readonly(
          "start_errors", [](Robot& robot) { return robot.manager().feedbackErrors(); },
          "Errors from loading the files of signals, managers and feedback controllers.")
      .def("add_motion", &addMotion, py::arg("id"), py::arg("motion"),
           "Loads a motion in Python under an id, see python_motion.hpp; (success, message).")
      .def("start_motion", &startMotion, py::arg("id"), py::arg("arguments") = py::dict(),
           py::arg("queue") = false,
           "Switches to a motion of add_motion() and starts it with these arguments; the others "
           "have their defaults. (accepted, message, number of the motion)")
      .def("motion_progress", &motionProgress, py::arg("id"),
           "{number, state, reason, reason_code, time, queued, error} of the current or last "
           "motion of an id; time: s of motion time, error: the Python message of a fault.")

      .def("open_stream", &openStream, py::arg("id"),
           "Opens the stream of velocities twist_stream or joint_velocity_stream: loads its "
           "controller, switches to it and lets it follow commands, until a cancel, a hold or a "
           "switch; (success, message).")
      .def(
          "stream_twist",
          [](Robot& robot, const std::vector<double>& twist) {
            return robot.keep(robot.stream("twist_stream").send(twist));
          },
          py::arg("twist"),
          "Twist of the palm in the base frame: three numbers m/s, three rad/s. It is followed for "
          "0.1 s, then the arm brakes; send another one before. (success, message)")
      .def(
          "stream_joint_velocity",
          [](Robot& robot, const std::vector<double>& velocity) {
            return robot.keep(robot.stream("joint_velocity_stream").send(velocity));
          },
          py::arg("velocity"), "The same with seven joint velocities, rad/s, in wire order.")

      .def(
          "load_dmps",
          [](Robot& robot, const std::string& filename) {
            int loaded = 0;
            const Answer answer = robot.dmp().loadDmps(filename, loaded);
            robot.reason_code = answer.number();
            return py::make_tuple(answer.success, answer.message, loaded);
          },
          py::arg("filename"), "(success, message, number of primitives)")
      .def(
          "execute_dmp",
          [](Robot& robot, const std::string& primitive, double ratio, const Vector3d& offset,
             bool orientation_control, const Eigen::Vector4d& orientation,
             const std::string& goal_frame, const Vector3d& region_low, const Vector3d& region_high,
             double retreat, double drop, const Vector3d& approach, double arrival_speed) {
            auto request =
                requestOf(primitive, ratio, offset, orientation_control, orientation, goal_frame);
            request.goal_limits = {region_low, region_high, retreat, drop};
            request.goal_approach = approach;
            request.arrival_speed = arrival_speed;
            return robot.keep(robot.dmp().execute(request));
          },
          py::arg("primitive_id"), py::arg("dmp_ratio") = 1.0,
          py::arg("goal_offset") = Vector3d(Vector3d::Zero()),
          py::arg("orientation_control") = false, py::arg("target_orientation") = noOrientation(),
          py::arg("goal_frame") = "", py::arg("goal_region_low") = Vector3d(Vector3d::Zero()),
          py::arg("goal_region_high") = Vector3d(Vector3d::Zero()), py::arg("goal_retreat") = 0.0,
          py::arg("goal_drop") = 0.0, py::arg("goal_approach") = Vector3d(Vector3d::Zero()),
          py::arg("arrival_speed") = 0.0, "Starts from the current state; (success, message).")
      .def(
          "switch_dmp",
          [](Robot& robot, const std::string& primitive, double ratio, const Vector3d& offset,
             bool orientation_control, const Eigen::Vector4d& orientation) {
            return robot.keep(robot.dmp().switchDmp(
                requestOf(primitive, ratio, offset, orientation_control, orientation, "")));
          },
          py::arg("primitive_id"), py::arg("dmp_ratio") = 1.0,
          py::arg("goal_offset") = Vector3d(Vector3d::Zero()),
          py::arg("orientation_control") = false, py::arg("target_orientation") = noOrientation())
      .def(
          "set_ik_debug", [](Robot& robot, bool on) { robot.dmp().setIkDebug(on); }, py::arg("on"),
          "Whether ik_debug() gets records; the DMP controller must be loaded.")
      .def(
          "ik_debug",
          [](Robot& robot) {
            py::list records;
            coglab_controllers::IkDebugRecord record;
            while (robot.dmp().readIkDebug(record)) records.append(debugOf(record));
            return records;
          },
          "Records of dmp/ik_debug since the last call: time s, goal m as estimated "
          "or latched, set_point and measured (position, quaternion) of the hand in the base "
          "frame.")
      .def("dmp_progress",
           [](Robot& robot) {
             coglab_controllers::DmpProgress progress;
             robot.dmp().readProgress(progress);
             py::dict result;
             result["primitive"] = std::string(progress.primitive.c_str());
             result["motion"] = std::string(nameOf(progress.state));
             result["reason"] = std::string(progress.reason.c_str());
             result["reason_code"] = progress.reason.number();
             result["phase"] = progress.phase;
             result["remaining_distance"] = progress.remaining_distance;
             result["remaining_time"] = progress.remaining_time;
             return result;
           })

      .def(
          "set_frame",
          [](Robot& robot, const std::string& frame, const Vector3d& position,
             const Eigen::Vector4d& rotation, double age) {
            robot.frames().set(frame, makePose(position, rotation),
                               robot.nowNs() - static_cast<std::int64_t>(std::llround(1e9 * age)));
          },
          py::arg("frame"), py::arg("position"), py::arg("rotation") = Eigen::Vector4d(0, 0, 0, 1),
          py::arg("age") = 0.0,
          "Sets the pose at which perception saw a frame in the world `age` s ago.")
      .def(
          "set_fixed_frame",
          [](Robot& robot, const std::string& frame, const Vector3d& position,
             const Eigen::Vector4d& rotation) {
            robot.frames().setFixed(frame, makePose(position, rotation));
          },
          py::arg("frame"), py::arg("position"), py::arg("rotation") = Eigen::Vector4d(0, 0, 0, 1),
          "Sets a frame that does not move: in each tick it counts as captured then.")
      .def("forget_frame",
           [](Robot& robot, const std::string& frame) { robot.frames().forget(frame); });
}
