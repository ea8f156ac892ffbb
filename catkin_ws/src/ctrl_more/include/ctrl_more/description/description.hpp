#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ctrl_more/states/cycle.hpp"
#include "ctrl_more/states/signal.hpp"

namespace ctrl_more {

/// What happens to a controller's last correction of a signal when it stops contributing.
enum class StopPolicy : std::uint8_t {
  ByKind,  ///< Hold for poses and orientations, Fade for everything else
  Hold,    ///< keep applying the last correction (the difference, not the absolute value)
  Fade,    ///< let it go to zero over the blend time
  Zero,    ///< drop it at once
};

/// `by kind`, `hold`, `fade` or `zero`.
const char* nameOf(StopPolicy policy);

/// What a controller's integrators do when the active motion controller changes.
enum class SwitchPolicy : std::uint8_t {
  Hold,   ///< keep the internal state
  Reset,  ///< reset(); the manager blends the correction over
};

/// What every declared thing has: a unit and a text, set by one call each. `Self` is the type that
/// inherits, so that calls can follow one another.
template <typename Self>
struct Documented {
  std::string unit;  ///< SI unit or list of units; required, "1" for a pure number
  std::string text;  ///< what it is, or what it does; required

  /// Sets the unit.
  Self& in(const std::string& units) { return unit = units, self(); }
  /// Sets the text.
  Self& about(const std::string& words) { return text = words, self(); }

 protected:
  /// The declaration itself.
  Self& self() { return static_cast<Self&>(*this); }
};

/// What every declared signal has besides.
template <typename Self>
struct SignalUse : Documented<Self> {
  std::string role;         ///< name within the controller, and the default key
  std::string key_setting;  ///< text setting that holds the key, "" if the key is `role`
  std::vector<int> sizes;   ///< allowed sizes; empty: the container's, or any
  std::string frame;        ///< required
  bool if_asked = false;    ///< used only if initialize() asks for it, by its settings

  /// Allows one more size.
  Self& size(int n) { return sizes.push_back(n), this->self(); }
  /// Sets the frame.
  Self& frameOf(const std::string& name) { return frame = name, this->self(); }
  /// Names the text setting with the key.
  Self& keyFrom(const std::string& setting) { return key_setting = setting, this->self(); }
  /// Makes the use depend on settings.
  Self& ifAsked() { return if_asked = true, this->self(); }
};

/// One robot signal that a controller reads.
struct RobotSignalUse : SignalUse<RobotSignalUse> {
  RobotSource source = RobotSource::Measured;  ///< which map
  double max_age_s = kUnlimited;  ///< older data stop the controller until fresh ones come

  /// Sets the largest age [s].
  RobotSignalUse& maxAge(double seconds) { return max_age_s = seconds, *this; }
};

/// Bounds on what a controller may do to one signal; beyond them its writes are undone.
struct CorrectionLimit {
  double size = kUnlimited;        ///< norm of the correction (for poses: of the position) [unit]
  double rate = kUnlimited;        ///< norm of its change per second [unit/s]
  double angle = kUnlimited;       ///< angle of the correction of an orientation [rad]
  double angle_rate = kUnlimited;  ///< its change per second [rad/s]
};

/// One control signal that a controller reads or modifies.
struct ControlSignalUse : SignalUse<ControlSignalUse> {
  ControlContainer container = ControlContainer::OtherReference;  ///< where it belongs
  bool modifies = false;                                          ///< false: read only
  bool exclusive = false;                    ///< no other enabled controller may modify the signal
  CorrectionLimit limit;                     ///< bounds on the correction
  StopPolicy on_pause = StopPolicy::ByKind;  ///< the correction while paused

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

  /// Makes it `n` elements, all `value` by default.
  GainSpec& vector(int n, double value) { return size = n, initial.assign(n, value), *this; }
  /// Sets min and max.
  GainSpec& range(double smallest, double largest) { return min = smallest, max = largest, *this; }
};

/// One setting: read once at initialize(), fixed until the controller is loaded again.
struct SettingSpec : Documented<SettingSpec> {
  /// What a setting holds.
  enum class Kind : std::uint8_t { Text, Numbers };

  std::string name;                  ///< key in the configuration file
  Kind kind = Kind::Text;            ///< text, or numbers (a unit is required for them only)
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

/// One number of a controller's inside that is worth watching, see FeedbackController::state().
struct StateSpec : Documented<StateSpec> {
  std::string name;  ///< unique within the controller
};

/// The one declaration of a controller. The run-time checks, the schema of its configuration file,
/// plot(), its generated page and the template of its configuration all come from here.
struct Description {
  std::string type;           ///< name under which the class is registered
  std::string summary;        ///< one sentence
  std::string use;            ///< how to use it: what must be connected to what
  std::string when;           ///< when to apply it, and when not
  std::string limitations;    ///< what it does not do
  std::string law;            ///< the control law, in LaTeX
  std::string source;         ///< where the law comes from
  std::string information;    ///< anything else the developer wants to say; may be empty
  Stage stage = Stage::Task;  ///< where in the cycle it runs
  bool safety = false;        ///< true: refuses pause and disable unless they are forced
  SwitchPolicy on_switch = SwitchPolicy::Reset;   ///< when the motion controller changes
  std::vector<RobotSignalUse> robot_signals;      ///< what it reads of the robot
  std::vector<ControlSignalUse> control_signals;  ///< what it reads and modifies
  std::vector<GainSpec> gains;                    ///< changeable while running
  std::vector<SettingSpec> settings;              ///< fixed at load
  std::vector<StateSpec> states;                  ///< what state() writes, in this order

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
  /// Adds several with one unit and text.
  void addStates(const std::vector<std::string>& names, const std::string& units,
                 const std::string& words) {
    for (const std::string& name : names) state(name).in(units).about(words);
  }

  /// What a manager needs to run the controller safely: names unique, sizes and ranges sensible,
  /// stage and modified containers in agreement. Empty if all is well, else one sentence each.
  std::vector<std::string> faults() const;

  /// What a reader needs: every text, unit and frame filled in. Empty if all is well, else one
  /// sentence per empty field. Tests fail on it.
  std::vector<std::string> emptyFields() const;
};

}  // namespace ctrl_more
