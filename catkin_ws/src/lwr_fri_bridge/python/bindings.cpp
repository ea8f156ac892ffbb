/// @file
/// Python module `lwr_fri_bridge`: the bridge in lockstep, one axis of the interpolator, and the
/// two datagrams as dictionaries. Arrays are numpy float64 in wire order; times in ns and s as in
/// the headers.
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "coglab_rt/joint_limits_table.hpp"
#include "lwr_fri_bridge/bridge/bridge.hpp"
#include "lwr_fri_bridge/bridge/diagnosis.hpp"

namespace py = pybind11;
using namespace lwr_fri_bridge;

namespace {

template <typename T, std::size_t N>
py::list listOf(const T (&values)[N]) {
  py::list list;
  for (const T value : values) list.append(value);
  return list;
}

template <typename T, std::size_t N>
void fromList(const py::dict& fields, const char* name, T (&values)[N]) {
  const auto list = fields[name].cast<std::vector<T>>();
  if (list.size() != N) {
    throw py::value_error(std::string(name) + ": expected " + std::to_string(N) + " values, got " +
                          std::to_string(list.size()));
  }
  std::copy(list.begin(), list.end(), values);
}

/// One visitor for both directions and both datagrams, so that dict and struct have the same names.
template <typename Visitor>
void visitCommon(fri::Header& header, fri::UserData& krl, Visitor&& visit) {
  visit("counter", header.counter);
  visit("reflected", header.reflected);
  visit("size", header.size);
  visit("id", header.id);
  visit("krl_reals", krl.reals);
  visit("krl_ints", krl.ints);
  visit("krl_bools", krl.bools);
}

template <typename Visitor>
void visitFields(fri::MeasurementDatagram& m, Visitor&& visit) {
  visitCommon(m.header, m.krl, visit);
  visit("timestamp", m.timestamp);
  visit("state", m.state);
  visit("quality", m.quality);
  visit("measurement_period", m.measurement_period);
  visit("command_period", m.command_period);
  visit("safety_scale", m.safety_scale);
  visit("answer_rate", m.answer_rate);
  visit("latency", m.latency);
  visit("jitter", m.jitter);
  visit("miss_rate", m.miss_rate);
  visit("miss_counter", m.miss_counter);
  visit("power", m.power);
  visit("control", m.control);
  visit("drive_error", m.drive_error);
  visit("drive_warning", m.drive_warning);
  visit("temperature", m.temperature);
  visit("measured_position", m.measured_position);
  visit("measured_frame", m.measured_frame);
  visit("commanded_position", m.commanded_position);
  visit("commanded_position_offset", m.commanded_position_offset);
  visit("commanded_frame", m.commanded_frame);
  visit("commanded_frame_offset", m.commanded_frame_offset);
  visit("measured_torque", m.measured_torque);
  visit("external_torque", m.external_torque);
  visit("external_wrench", m.external_wrench);
  visit("jacobian", m.jacobian);
  visit("mass_matrix", m.mass_matrix);
  visit("gravity", m.gravity);
}

template <typename Visitor>
void visitFields(fri::CommandDatagram& c, Visitor&& visit) {
  visitCommon(c.header, c.krl, visit);
  visit("flags", c.flags);
  visit("joint_position", c.joint_position);
  visit("cartesian_frame", c.cartesian_frame);
  visit("joint_torque", c.joint_torque);
  visit("cartesian_force", c.cartesian_force);
  visit("joint_stiffness", c.joint_stiffness);
  visit("joint_damping", c.joint_damping);
  visit("cartesian_stiffness", c.cartesian_stiffness);
  visit("cartesian_damping", c.cartesian_damping);
}

struct ToDict {
  py::dict fields;
  template <typename T>
  void operator()(const char* name, T& value) {
    if constexpr (std::is_array_v<T>) {
      fields[name] = listOf(value);
    } else {
      fields[name] = value;
    }
  }
};

struct FromDict {
  const py::dict& fields;
  template <typename T>
  void operator()(const char* name, T& value) const {
    if (!fields.contains(name)) return;  // omitted fields stay zero
    if constexpr (std::is_array_v<T>) {
      fromList(fields, name, value);
    } else {
      value = fields[name].cast<T>();
    }
  }
};

template <typename Datagram>
py::dict decodeToDict(const py::bytes& bytes) {
  const std::string text = bytes;
  Datagram datagram;
  if (!fri::decode(reinterpret_cast<const std::uint8_t*>(text.data()), text.size(), datagram)) {
    throw py::value_error("expected " + std::to_string(sizeof(Datagram)) + " bytes, got " +
                          std::to_string(text.size()));
  }
  ToDict visitor;
  visitFields(datagram, visitor);
  return visitor.fields;
}

template <typename Datagram>
py::bytes encodeFromDict(const py::dict& fields) {
  Datagram datagram{};
  visitFields(datagram, FromDict{fields});
  std::uint8_t bytes[sizeof(Datagram)];
  fri::encode(datagram, bytes);
  return py::bytes(reinterpret_cast<const char*>(bytes), sizeof bytes);
}

py::dict sampleDict(const RobotSample& s) {
  py::dict d;
  d["sequence"] = s.sequence;
  d["stamp_ns"] = s.stamp_ns;
  d["controller_ns"] = s.controller_ns;
  d["cycle_time"] = s.cycle_time;
  d["position"] = s.position;
  d["velocity"] = s.velocity;
  d["torque"] = s.torque;
  d["external_torque"] = s.external_torque;
  d["tool_wrench"] = s.tool_wrench;
  d["commanded_position"] = s.commanded_position;
  d["commanded_velocity"] = s.commanded_velocity;
  d["commanded_acceleration"] = s.commanded_acceleration;
  d["motion_allowed"] = s.block == MotionBlock::None;
  d["reason"] = reasonOf(s.block, s.blocking_joint);
  d["motion_epoch"] = s.motion_epoch;
  return d;
}

py::dict snapshotDict(const Snapshot& s) {
  py::dict d = sampleDict(s.sample);
  d["supervisor"] = nameOf(s.supervisor);
  d["hold_latched"] = s.hold_latched;
  d["fri_state"] = fri::nameOf(s.state);
  d["quality"] = fri::nameOf(s.quality);
  d["control_mode"] = fri::nameOf(s.control);
  d["fall_backs"] = s.fall_backs;
  d["loss"] = describe(s.loss);
  d["accepted"] = s.session.accepted;
  d["wrong_size"] = s.session.wrong_size;
  d["wrong_id"] = s.session.wrong_id;
  d["implausible"] = s.session.implausible;
  d["duplicate"] = s.session.duplicate;
  d["out_of_order"] = s.session.out_of_order;
  d["lost_measurements"] = s.session.lost_measurements;
  d["lost_answers"] = s.session.lost_answers;
  d["restarts"] = s.session.restarts;
  d["new_periods"] = s.session.new_periods;
  d["cycle_time"] = s.sample.cycle_time;
  d["commands_invalid"] = s.counters.commands_invalid;
  d["commands_old_epoch"] = s.counters.commands_old_epoch;
  d["command_timeouts"] = s.counters.command_timeouts;
  d["resumed_after_gap"] = s.counters.resumed_after_gap;
  d["position_bounds"] = s.counters.position_bounds;
  d["leash_trips"] = s.counters.leash_trips;
  d["requests_dropped"] = s.counters.requests_dropped;
  return d;
}

BridgeConfig configFrom(const std::string& limits_file, const std::string& profile,
                        const py::dict& parameters) {
  BridgeConfig config;
  config.limits = coglab_rt::loadJointLimits(limits_file, profile);
  for (const auto& item : parameters) {
    const auto name = item.first.cast<std::string>();
    const py::handle value = item.second;
    if (name == "krl_convention") {
      config.krl_convention = fri::krlConventionFromName(value.cast<std::string>());
    } else if (name == "control_mode") {
      config.mode = parseEvent(value.cast<std::string>(), config.mode).mode;
    } else if (name == "lenient_headers") {
      config.lenient_headers = value.cast<bool>();
    } else if (name == "wrench_in_tool_axes") {
      config.wrench_in_tool_axes = value.cast<bool>();
    } else if (name == "tool_number") {
      config.tool_number = value.cast<int>();
    } else {
      double* const target = name == "position_margin"        ? &config.position_margin
                             : name == "leash_position"       ? &config.leash.position
                             : name == "leash_impedance"      ? &config.leash.impedance
                             : name == "leash_load"           ? &config.leash.load
                             : name == "velocity_filter_time" ? &config.velocity_filter_time
                             : name == "command_timeout"      ? &config.command_timeout
                             : name == "topic_timeout"        ? &config.topic_timeout
                             : name == "receive_timeout"      ? &config.receive_timeout
                             : name == "start_timeout"        ? &config.requests.start_timeout
                             : name == "stop_timeout"         ? &config.requests.stop_timeout
                             : name == "silent_stop_timeout"  ? &config.requests.silent_stop_timeout
                                                              : nullptr;
      if (target == nullptr) throw py::value_error("unknown parameter '" + name + "'");
      *target = value.cast<double>();
    }
  }
  return config;
}

void bindDatagrams(py::module_& m) {
  m.attr("MEASUREMENT_SIZE") = fri::kMeasurementSize;
  m.attr("COMMAND_SIZE") = fri::kCommandSize;
  m.def("decode_measurement", &decodeToDict<fri::MeasurementDatagram>, py::arg("datagram"));
  m.def("decode_command", &decodeToDict<fri::CommandDatagram>, py::arg("datagram"));
  m.def("encode_measurement", &encodeFromDict<fri::MeasurementDatagram>, py::arg("fields"));
  m.def("encode_command", &encodeFromDict<fri::CommandDatagram>, py::arg("fields"));
}

void bindLimits(py::module_& m) {
  py::class_<JointLimits>(m, "JointLimits", py::module_local())
      .def(py::init([](const std::string& path, const std::string& profile) {
             return coglab_rt::loadJointLimits(path, profile);
           }),
           py::arg("path"), py::arg("profile") = "default")
      .def_readonly("lower_position", &JointLimits::lower_position)
      .def_readonly("upper_position", &JointLimits::upper_position)
      .def_readonly("velocity", &JointLimits::velocity)
      .def_readonly("acceleration", &JointLimits::acceleration)
      .def_readonly("jerk", &JointLimits::jerk)
      .def_readonly("torque", &JointLimits::torque);
}

void bindMotionFunctions(py::module_& m) {
  m.def(
      "step_axis",
      [](double p, double v, double a, double target, double max_acceleration, double max_jerk,
         double dt) {
        const AxisState s =
            advance({p, v, a}, planVelocity(v, a, target, max_acceleration, max_jerk), dt);
        return py::make_tuple(s.position, s.velocity, s.acceleration);
      },
      "State (position, velocity, acceleration) of one axis after dt on the way to the target "
      "velocity.",
      py::arg("position"), py::arg("velocity"), py::arg("acceleration"), py::arg("target_velocity"),
      py::arg("max_acceleration"), py::arg("max_jerk"), py::arg("dt"));
  m.def(
      "time_to_velocity",
      [](double v, double a, double target, double max_acceleration, double max_jerk) {
        return planVelocity(v, a, target, max_acceleration, max_jerk).totalTime();
      },
      py::arg("velocity"), py::arg("acceleration"), py::arg("target_velocity"),
      py::arg("max_acceleration"), py::arg("max_jerk"));
  m.def(
      "flange_pose",
      [](const Vector7& joints) { return Eigen::Matrix4d(flangePose(joints).matrix()); },
      "4x4 pose of the flange in the base frame.", py::arg("joints"));
  m.def("known_events", &knownEvents);
}

void bindBridge(py::module_& m) {
  py::class_<Bridge>(m, "Bridge", py::module_local(),
                     "The bridge without socket and threads: one call of answer() is one FRI tick.")
      .def(py::init([](const std::string& limits_file, const std::string& profile,
                       const py::kwargs& parameters) {
             return std::make_unique<Bridge>(configFrom(limits_file, profile, parameters));
           }),
           py::arg("limits_file"), py::arg("profile") = "default")
      .def(
          "answer",
          [](Bridge& bridge, const py::bytes& datagram, std::int64_t now_ns) -> py::object {
            const std::string text = datagram;
            fri::CommandDatagram command;
            if (!bridge.answer(reinterpret_cast<const std::uint8_t*>(text.data()), text.size(),
                               now_ns, command)) {
              return py::none();
            }
            return py::bytes(reinterpret_cast<const char*>(&command), sizeof command);
          },
          "The answer to a measurement datagram, or None if it deserves none.", py::arg("datagram"),
          py::arg("now_ns"))
      .def("idle", &Bridge::idle, py::arg("now_ns"))
      .def(
          "send_velocity",
          [](Bridge& bridge, const Vector7& velocity, std::int64_t now_ns) {
            RobotSample sample;
            bridge.mailboxes().newestSample(sample);
            bridge.mailboxes().sendVelocity({velocity, now_ns, sample.motion_epoch});
          },
          "Target velocities (rad/s) as the control thread sends them, for the epoch of the newest "
          "sample.",
          py::arg("velocity"), py::arg("now_ns"))
      .def("submit", &Bridge::submit, py::arg("event"))
      .def(
          "outcome",
          [](Bridge& bridge, std::uint32_t ticket) -> py::object {
            const Outcome outcome = bridge.outcome(ticket);
            if (outcome.code == OutcomeCode::Pending) return py::none();
            return py::make_tuple(outcome.success(), describe(outcome));
          },
          "(success, message) of a submitted event, or None while it is not finished.",
          py::arg("ticket"))
      .def("snapshot", [](Bridge& bridge) { return snapshotDict(bridge.snapshot()); });
}

}  // namespace

PYBIND11_MODULE(lwr_fri_bridge, m) {
  m.doc() =
      "FRI bridge of the KUKA LWR 4+: the bridge in lockstep, datagrams, one axis of its motion.";
  bindDatagrams(m);
  bindLimits(m);
  bindMotionFunctions(m);
  bindBridge(m);
}
