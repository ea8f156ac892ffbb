#include "bindings.hpp"
#include "setup_view.hpp"

namespace ctrl_more::python {
namespace {

// One size or several, as the caller wrote it.
std::vector<int> sizesOf(const py::object& size) {
  if (size.is_none()) return {};
  if (py::isinstance<py::int_>(size)) return {size.cast<int>()};
  return size.cast<std::vector<int>>();
}

template <typename Use>
void fill(Use& use, const py::object& size, const std::string& unit, const std::string& frame,
          const std::string& text, const std::string& key_from, bool if_asked) {
  use.sizes = sizesOf(size);
  use.unit = unit;
  use.frame = frame;
  use.text = text;
  use.key_setting = key_from;
  use.if_asked = if_asked;
}

template <typename Type>
void bindUse(Type& type) {
  using Use = typename Type::type;
  type.def_readonly("role", &Use::role)
      .def_readonly("key_from", &Use::key_setting)
      .def_readonly("sizes", &Use::sizes)
      .def_readonly("unit", &Use::unit)
      .def_readonly("frame", &Use::frame)
      .def_readonly("text", &Use::text)
      .def_readonly("if_asked", &Use::if_asked);
}

void bindParts(py::module_& module) {
  py::class_<RobotSignalUse> robot(module, "RobotSignalUse",
                                   "A robot signal that a controller reads.");
  bindUse(robot);
  robot.def_property_readonly("source", [](const RobotSignalUse& u) { return nameOf(u.source); })
      .def_readonly("max_age", &RobotSignalUse::max_age_s);

  py::class_<CorrectionLimit>(module, "CorrectionLimit", "Bounds of a correction.")
      .def(py::init([](double size, double rate, double angle, double angle_rate) {
             return CorrectionLimit{size, rate, angle, angle_rate};
           }),
           py::arg("size") = kUnlimited, py::arg("rate") = kUnlimited,
           py::arg("angle") = kUnlimited, py::arg("angle_rate") = kUnlimited)
      .def_readonly("size", &CorrectionLimit::size)
      .def_readonly("rate", &CorrectionLimit::rate)
      .def_readonly("angle", &CorrectionLimit::angle)
      .def_readonly("angle_rate", &CorrectionLimit::angle_rate);

  py::class_<ControlSignalUse> control(module, "ControlSignalUse",
                                       "A control signal that a controller reads or modifies.");
  bindUse(control);
  control
      .def_property_readonly("container",
                             [](const ControlSignalUse& u) { return nameOf(u.container); })
      .def_readonly("modifies", &ControlSignalUse::modifies)
      .def_readonly("exclusive", &ControlSignalUse::exclusive)
      .def_readonly("limit", &ControlSignalUse::limit)
      .def_property_readonly("when_paused",
                             [](const ControlSignalUse& u) { return nameOf(u.on_pause); });

  py::class_<GainSpec>(module, "GainSpec", "A gain, changeable while the controller runs.")
      .def_readonly("name", &GainSpec::name)
      .def_readonly("size", &GainSpec::size)
      .def_readonly("low", &GainSpec::min)
      .def_readonly("high", &GainSpec::max)
      .def_readonly("initial", &GainSpec::initial)
      .def_readonly("unit", &GainSpec::unit)
      .def_readonly("text", &GainSpec::text);
  py::class_<SettingSpec>(module, "SettingSpec", "A setting, fixed when the controller is loaded.")
      .def_readonly("name", &SettingSpec::name)
      .def_readonly("initial_text", &SettingSpec::initial_text)
      .def_readonly("initial", &SettingSpec::initial)
      .def_readonly("choices", &SettingSpec::choices)
      .def_readonly("unit", &SettingSpec::unit)
      .def_readonly("text", &SettingSpec::text);
  py::class_<StateSpec>(module, "StateSpec", "A number that state() returns.")
      .def_readonly("name", &StateSpec::name)
      .def_readonly("unit", &StateSpec::unit)
      .def_readonly("text", &StateSpec::text);
}

SwitchPolicy toSwitch(const std::string& text) {
  if (text == "reset") return SwitchPolicy::Reset;
  if (text == "hold") return SwitchPolicy::Hold;
  refuse("on_switch: expected 'reset' or 'hold', got '" + text + "'");
}

template <typename Class>
void bindSignals(Class& type) {
  const auto robot = [&](const char* name, RobotSource source) {
    type.def(
        name,
        [source](Description& d, const std::string& role, const py::object& size,
                 const std::string& unit, const std::string& frame, const std::string& text,
                 double max_age, const std::string& key_from, bool if_asked) {
          RobotSignalUse& use =
              source == RobotSource::Measured ? d.measured(role) : d.estimated(role);
          fill(use, size, unit, frame, text, key_from, if_asked);
          use.max_age_s = max_age;
        },
        py::arg("role"), py::kw_only(), py::arg("size") = py::none(), py::arg("unit") = "",
        py::arg("frame") = "", py::arg("text") = "", py::arg("max_age") = kUnlimited,
        py::arg("key_from") = "", py::arg("if_asked") = false);
  };
  robot("measured", RobotSource::Measured);
  robot("estimated", RobotSource::Estimated);
  type.def(
      "reads",
      [](Description& d, const std::string& container, const std::string& role,
         const py::object& size, const std::string& unit, const std::string& frame,
         const std::string& text, const std::string& key_from, bool if_asked) {
        fill(d.reads(toContainer(container), role), size, unit, frame, text, key_from, if_asked);
      },
      py::arg("container"), py::arg("role"), py::kw_only(), py::arg("size") = py::none(),
      py::arg("unit") = "", py::arg("frame") = "", py::arg("text") = "", py::arg("key_from") = "",
      py::arg("if_asked") = false);
  type.def(
      "modifies",
      [](Description& d, const std::string& container, const std::string& role,
         const py::object& size, const std::string& unit, const std::string& frame,
         const std::string& text, const CorrectionLimit& limit, bool exclusive,
         const std::string& when_paused, const std::string& key_from, bool if_asked) {
        ControlSignalUse& use = d.modifies(toContainer(container), role);
        fill(use, size, unit, frame, text, key_from, if_asked);
        use.limit = limit;
        use.exclusive = exclusive;
        use.on_pause = toPolicy(when_paused);
      },
      py::arg("container"), py::arg("role"), py::kw_only(), py::arg("size") = py::none(),
      py::arg("unit") = "", py::arg("frame") = "", py::arg("text") = "",
      py::arg("limit") = CorrectionLimit(), py::arg("exclusive") = false,
      py::arg("when_paused") = "by kind", py::arg("key_from") = "", py::arg("if_asked") = false);
}

template <typename Class>
void bindValues(Class& type) {
  type.def(
      "gain",
      [](Description& d, const std::string& name, const py::object& initial, double low,
         double high, const std::string& unit, const std::string& text) {
        const bool one = PyFloat_Check(initial.ptr()) || PyLong_Check(initial.ptr());
        GainSpec& gain = d.gain(name, 0.0);
        if (one) {
          gain.initial = {initial.cast<double>()};
        } else {
          const Eigen::VectorXd values = toVector(initial, "gain " + name);
          gain.initial.assign(values.data(), values.data() + values.size());
        }
        gain.size = static_cast<int>(gain.initial.size());
        gain.min = low;
        gain.max = high;
        gain.unit = unit;
        gain.text = text;
      },
      py::arg("name"), py::arg("initial"), py::kw_only(), py::arg("low") = -kUnlimited,
      py::arg("high") = kUnlimited, py::arg("unit") = "", py::arg("text") = "");
  type.def(
      "setting",
      [](Description& d, const std::string& name, const py::object& initial,
         const std::vector<std::string>& choices, double low, double high, bool any_size,
         const std::string& unit, const std::string& text) {
        if (py::isinstance<py::str>(initial)) {
          SettingSpec& setting = d.setting(name, initial.cast<std::string>());
          setting.choices = choices;
          setting.unit = unit;
          setting.text = text;
          return;
        }
        const bool one = PyFloat_Check(initial.ptr()) || PyLong_Check(initial.ptr());
        const Eigen::VectorXd values = one ? Eigen::VectorXd::Constant(1, initial.cast<double>())
                                           : toVector(initial, "setting " + name);
        SettingSpec& setting =
            d.setting(name, std::vector<double>(values.data(), values.data() + values.size()));
        setting.min = low;
        setting.max = high;
        setting.any_size = any_size;
        setting.unit = unit;
        setting.text = text;
      },
      py::arg("name"), py::arg("initial"), py::kw_only(),
      py::arg("choices") = std::vector<std::string>(), py::arg("low") = -kUnlimited,
      py::arg("high") = kUnlimited, py::arg("any_size") = false, py::arg("unit") = "",
      py::arg("text") = "");
  type.def(
      "state",
      [](Description& d, const std::string& name, const std::string& unit,
         const std::string& text) { d.state(name).in(unit).about(text); },
      py::arg("name"), py::kw_only(), py::arg("unit") = "", py::arg("text") = "");
}

void bindSetup(py::module_& module) {
  py::class_<SetupView>(module, "Setup", "Argument of initialize(): handles, gains and settings.")
      .def(
          "read",
          [](SetupView& v, const std::string& role, int size) {
            return v.setup().read<>(role, size);
          },
          py::arg("role"), py::arg("size") = 0)
      .def(
          "reference",
          [](SetupView& v, const std::string& role, int size) {
            return v.setup().reference<>(role, size);
          },
          py::arg("role"), py::arg("size") = 0)
      .def(
          "modify",
          [](SetupView& v, const std::string& role, int size) {
            return v.setup().modify<>(role, size);
          },
          py::arg("role"), py::arg("size") = 0)
      .def(
          "gain", [](SetupView& v, const std::string& name) { return v.setup().gain(name); },
          py::arg("name"))
      .def(
          "text", [](SetupView& v, const std::string& name) { return v.setup().text(name); },
          py::arg("name"))
      .def(
          "numbers",
          [](SetupView& v, const std::string& name) -> Eigen::VectorXd {
            const std::vector<double>& n = v.setup().numbers(name);
            return Eigen::Map<const Eigen::VectorXd>(n.data(), static_cast<int>(n.size()));
          },
          py::arg("name"))
      .def_property_readonly("joints", [](SetupView& v) { return v.setup().joints(); })
      .def_property_readonly("period", [](SetupView& v) { return v.setup().period(); });
  py::class_<Gain>(module, "Gain", "Handle of a gain.").def_property_readonly("size", &Gain::size);
}

}  // namespace

void bindDescription(py::module_& module) {
  bindParts(module);
  py::class_<Description> type(module, "Description", "Declaration of a controller.");
  type.def(
      py::init([](const std::string& summary, const std::string& use, const std::string& when,
                  const std::string& limitations, const std::string& law, const std::string& source,
                  const std::string& information, const std::string& stage, bool safety,
                  const std::string& on_switch, const std::string& name) {
        Description d;
        d.type = name;
        d.summary = summary;
        d.use = use;
        d.when = when;
        d.limitations = limitations;
        d.law = law;
        d.source = source;
        d.information = information;
        d.stage = toStage(stage);
        d.safety = safety;
        d.on_switch = toSwitch(on_switch);
        return d;
      }),
      py::arg("summary") = "", py::kw_only(), py::arg("use") = "", py::arg("when") = "",
      py::arg("limitations") = "", py::arg("law") = "", py::arg("source") = "",
      py::arg("information") = "", py::arg("stage") = "task", py::arg("safety") = false,
      py::arg("on_switch") = "reset", py::arg("type") = "");
  type.def_readwrite("type", &Description::type)
      .def_readwrite("summary", &Description::summary)
      .def_readwrite("use", &Description::use)
      .def_readwrite("when", &Description::when)
      .def_readwrite("limitations", &Description::limitations)
      .def_readwrite("law", &Description::law)
      .def_readwrite("source", &Description::source)
      .def_readwrite("information", &Description::information)
      .def_readwrite("safety", &Description::safety)
      .def_property(
          "stage", [](const Description& d) { return nameOf(d.stage); },
          [](Description& d, const std::string& stage) { d.stage = toStage(stage); })
      .def_readonly("robot_signals", &Description::robot_signals)
      .def_readonly("control_signals", &Description::control_signals)
      .def_readonly("gains", &Description::gains)
      .def_readonly("settings", &Description::settings)
      .def_readonly("states", &Description::states)
      .def("faults", &Description::faults)
      .def("empty_fields", &Description::emptyFields)
      .def("page", &documentationPage)
      .def("config", &configurationTemplate);
  bindSignals(type);
  bindValues(type);
  bindSetup(module);
}

}  // namespace ctrl_more::python
