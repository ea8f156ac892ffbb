#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ctrl_more/states/cycle.hpp"
#include "ctrl_more/states/signal.hpp"

namespace ctrl_more {

/// Policy for a controller's last correction of a signal when the controller stops.
enum class StopPolicy : std::uint8_t {
  ByKind,  ///< Hold for poses and orientations, Fade for everything else
  Hold,    ///< keep applying the last correction (the difference, not the absolute value)
  Fade,    ///< blend the correction to zero over the blend time
  Zero,    ///< remove the correction at once
};

/// `by kind`, `hold`, `fade` or `zero`.
const char* nameOf(StopPolicy policy);

/// Policy for a controller's integrators when the active motion controller changes.
enum class SwitchPolicy : std::uint8_t {
  Hold,   ///< keep the internal state
  Reset,  ///< call reset(); the manager blends the correction
};

/// Unit and text of a declaration. `Self` is the derived type, so that calls can be chained.
template <typename Self>
struct Documented {
  std::string unit;  ///< SI unit or list of units; required, "1" for a pure number
  std::string text;  ///< description for the reader; required

  /// Sets the unit.
  Self& in(const std::string& units) { return unit = units, self(); }
  /// Sets the text.
  Self& about(const std::string& words) { return text = words, self(); }

 protected:
  /// The declaration itself.
  Self& self() { return static_cast<Self&>(*this); }
};

/// Common fields of every declared signal.
template <typename Self>
struct SignalUse : Documented<Self> {
  std::string role;         ///< name within the controller, and the default key
  std::string key_setting;  ///< text setting that contains the key; "": the key is `role`
  std::vector<int> sizes;   ///< allowed sizes; empty: the container's, or any
  std::string frame;        ///< frame of the numbers; required
  bool if_asked = false;    ///< used only if initialize() requests it, depending on settings

  /// Allows one more size.
  Self& size(int n) { return sizes.push_back(n), this->self(); }
  /// Sets the frame.
  Self& frameOf(const std::string& name) { return frame = name, this->self(); }
  /// Sets the text setting that contains the key.
  Self& keyFrom(const std::string& setting) { return key_setting = setting, this->self(); }
  /// Uses the signal only if initialize() requests it.
  Self& ifAsked() { return if_asked = true, this->self(); }
};

/// One robot signal that a controller reads.
struct RobotSignalUse : SignalUse<RobotSignalUse> {
  RobotSource source = RobotSource::Measured;  ///< map of the signal
  double max_age_s = kUnlimited;               ///< [s]; older data stop the controller

  /// Sets the largest age [s].
  RobotSignalUse& maxAge(double seconds) { return max_age_s = seconds, *this; }
};

/// Bounds of a controller's correction of one signal. Beyond them its writes are undone.
struct CorrectionLimit {
  double size = kUnlimited;        ///< norm of the correction (for poses: of the position) [unit]
  double rate = kUnlimited;        ///< norm of its change per second [unit/s]
  double angle = kUnlimited;       ///< angle of the correction of an orientation [rad]
  double angle_rate = kUnlimited;  ///< its change per second [rad/s]
};

/// One control signal that a controller reads or modifies.
struct ControlSignalUse : SignalUse<ControlSignalUse> {
  ControlContainer container = ControlContainer::OtherReference;  ///< container of the signal
  bool modifies = false;                                          ///< false: read only
  bool exclusive = false;                    ///< no other enabled controller may modify the signal
  CorrectionLimit limit;                     ///< bounds on the correction
  StopPolicy on_pause = StopPolicy::ByKind;  ///< policy while paused

  /// Makes the use exclusive.
  ControlSignalUse& alone() { return exclusive = true, *this; }
  /// Sets the bounds.
  ControlSignalUse& bounded(const CorrectionLimit& limits) { return limit = limits, *this; }
  /// Sets on_pause.
  ControlSignalUse& whenPaused(StopPolicy policy) { return on_pause = policy, *this; }
};

/// One gain: a number or a vector that may change while the controller runs.
struct GainSpec : Documented<GainSpec> {
  std::string name;             ///< key in the configuration file
  int size = 1;                 ///< number of doubles
  double min = -kUnlimited;     ///< smallest value allowed, each element
  double max = kUnlimited;      ///< largest value allowed, each element
  std::vector<double> initial;  ///< value if the file does not give one; `size` doubles

  /// Sets the size to `n` and all initial values to `value`.
  GainSpec& vector(int n, double value) { return size = n, initial.assign(n, value), *this; }
  /// Sets min and max.
  GainSpec& range(double smallest, double largest) { return min = smallest, max = largest, *this; }
};

/// One setting. It is read once at initialize() and fixed until the controller is loaded again.
struct SettingSpec : Documented<SettingSpec> {
  /// Type of a setting.
  enum class Kind : std::uint8_t { Text, Numbers };

  std::string name;                  ///< key in the configuration file
  Kind kind = Kind::Text;            ///< text, or numbers (only numbers need a unit)
  std::string initial_text;          ///< text if the file does not give one
  std::vector<std::string> choices;  ///< allowed texts; empty: any
  std::vector<double> initial;       ///< numbers if the file does not give any
  bool any_size = false;             ///< the file may give another count of numbers
  double min = -kUnlimited;          ///< smallest number allowed
  double max = kUnlimited;           ///< largest number allowed

  /// Sets the allowed texts.
  SettingSpec& oneOf(const std::vector<std::string>& texts) { return choices = texts, *this; }
  /// Sets min and max.
  SettingSpec& range(double smallest, double largest) {
    return min = smallest, max = largest, *this;
  }
  /// Allows any count of numbers.
  SettingSpec& anySize() { return any_size = true, *this; }
};

/// One internal number of a controller for display, see FeedbackController::state().
struct StateSpec : Documented<StateSpec> {
  std::string name;  ///< unique within the controller
};

/// Declaration of a controller. It is the source of the run-time checks, the schema and the
/// template of the configuration file, plot() and the generated documentation page.
struct Description {
  std::string type;           ///< name under which the class is registered
  std::string summary;        ///< one sentence
  std::string use;            ///< how to use it: which signals to connect
  std::string when;           ///< when to apply it, and when not
  std::string limitations;    ///< known limitations
  std::string law;            ///< the control law, in LaTeX
  std::string source;         ///< source of the law
  std::string information;    ///< additional information; may be empty
  Stage stage = Stage::Task;  ///< stage of the cycle in which it runs
  bool safety = false;        ///< true: refuses pause and disable unless they are forced
  SwitchPolicy on_switch = SwitchPolicy::Reset;   ///< when the motion controller changes
  std::vector<RobotSignalUse> robot_signals;      ///< robot signals that it reads
  std::vector<ControlSignalUse> control_signals;  ///< control signals that it reads or modifies
  std::vector<GainSpec> gains;                    ///< changeable while running
  std::vector<SettingSpec> settings;              ///< fixed at load
  std::vector<StateSpec> states;                  ///< numbers that state() writes, in this order

  /// Adds a signal of `measuredData`.
  RobotSignalUse& measured(const std::string& role);
  /// Adds a signal of `estimatedData`.
  RobotSignalUse& estimated(const std::string& role);
  /// Adds a control signal that is only read.
  ControlSignalUse& reads(ControlContainer container, const std::string& role);
  /// Adds a control signal that is modified.
  ControlSignalUse& modifies(ControlContainer container, const std::string& role);
  /// Adds a scalar gain.
  GainSpec& gain(const std::string& name, double initial);
  /// Adds a text setting.
  SettingSpec& setting(const std::string& name, const std::string& initial);
  /// Adds a setting of as many numbers as `initial` has.
  SettingSpec& setting(const std::string& name, const std::vector<double>& initial);

  /// Adds a number that state() writes.
  StateSpec& state(const std::string& name);
  /// Adds several states with the same unit and text.
  void addStates(const std::vector<std::string>& names, const std::string& units,
                 const std::string& words) {
    for (const std::string& name : names) state(name).in(units).about(words);
  }

  /// Errors that prevent a safe run, one sentence each: names that are not unique, invalid sizes or
  /// ranges, modified containers that do not fit the stage. Empty if there are none.
  std::vector<std::string> faults() const;

  /// One sentence for each empty text, unit or frame. The tests of the controller require that
  /// there are none.
  std::vector<std::string> emptyFields() const;
};

}  // namespace ctrl_more
