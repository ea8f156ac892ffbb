#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ctrl_more/cycle.hpp"
#include "ctrl_more/signal.hpp"

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

/// One robot signal that a controller reads.
struct RobotSignalUse {
  RobotSource source = RobotSource::Measured;  ///< which map
  std::string role;         ///< name within the controller, and the default key
  std::string key_setting;  ///< text setting that holds the key, "" if the key is `role`
  std::vector<int> sizes;   ///< allowed sizes; empty: any
  std::string unit;         ///< required
  std::string frame;        ///< required
  std::string text;         ///< what it is, layout included; required
  double max_age_s = kUnlimited;  ///< older data stop the controller until fresh ones come
  bool if_asked = false;  ///< used only if initialize() asks for it, by its settings

  RobotSignalUse& size(int n);                     ///< allows one more size
  RobotSignalUse& in(const std::string& units);    ///< sets the unit
  RobotSignalUse& frameOf(const std::string& name);  ///< sets the frame
  RobotSignalUse& about(const std::string& words);   ///< sets the text
  RobotSignalUse& keyFrom(const std::string& setting);  ///< names the text setting with the key
  RobotSignalUse& maxAge(double seconds);            ///< sets the largest age [s]
  RobotSignalUse& ifAsked();                         ///< makes the use depend on settings
};

/// Bounds on what a controller may do to one signal; beyond them its writes are undone.
struct CorrectionLimit {
  double size = kUnlimited;  ///< norm of the correction (for poses: of the position) [unit]
  double rate = kUnlimited;  ///< norm of its change per second [unit/s]
  double angle = kUnlimited;       ///< angle of the correction of an orientation [rad]
  double angle_rate = kUnlimited;  ///< its change per second [rad/s]
};

/// One control signal that a controller reads or modifies.
struct ControlSignalUse {
  ControlContainer container = ControlContainer::OtherReference;  ///< where it belongs
  std::string role;         ///< name within the controller, and the default key
  std::string key_setting;  ///< text setting that holds the key, "" if the key is `role`
  std::vector<int> sizes;   ///< allowed sizes; empty: the container's, or any
  std::string unit;         ///< required
  std::string frame;        ///< required
  std::string text;         ///< what it is, or what is done to it; required
  bool modifies = false;    ///< false: read only
  bool exclusive = false;   ///< no other enabled controller may modify the signal
  CorrectionLimit limit;    ///< bounds on the correction
  StopPolicy on_pause = StopPolicy::ByKind;  ///< the correction while paused
  bool if_asked = false;  ///< used only if initialize() asks for it, by its settings

  ControlSignalUse& size(int n);                       ///< allows one more size
  ControlSignalUse& in(const std::string& units);      ///< sets the unit
  ControlSignalUse& frameOf(const std::string& name);  ///< sets the frame
  ControlSignalUse& about(const std::string& words);   ///< sets the text
  ControlSignalUse& keyFrom(const std::string& setting);  ///< names the text setting with the key
  ControlSignalUse& alone();                              ///< makes the use exclusive
  ControlSignalUse& bounded(const CorrectionLimit& limits);  ///< sets the bounds
  ControlSignalUse& whenPaused(StopPolicy policy);           ///< sets on_pause
  ControlSignalUse& ifAsked();  ///< makes the use depend on settings
};

/// One gain: a number or a vector that may change while the controller runs.
struct GainSpec {
  std::string name;             ///< key in the configuration file
  std::string unit;             ///< SI; "1" for a pure number; required
  std::string text;             ///< what it does; required
  int size = 1;                 ///< number of doubles
  double min = -kUnlimited;     ///< smallest value allowed, each element
  double max = kUnlimited;      ///< largest value allowed, each element
  std::vector<double> initial;  ///< value if the file does not give one; `size` doubles

  GainSpec& vector(int n, double value);            ///< n elements, all `value` by default
  GainSpec& range(double smallest, double largest);  ///< sets min and max
  GainSpec& in(const std::string& units);            ///< sets the unit
  GainSpec& about(const std::string& words);         ///< sets the text
};

/// One setting: read once at initialize(), fixed until the controller is loaded again.
struct SettingSpec {
  /// What a setting holds.
  enum class Kind : std::uint8_t { Text, Numbers };

  std::string name;                  ///< key in the configuration file
  Kind kind = Kind::Text;            ///< text, or numbers
  std::string unit;                  ///< of numbers; required for them
  std::string text;                  ///< what it does; required
  std::string initial_text;          ///< text if the file does not give one
  std::vector<std::string> choices;  ///< allowed texts; empty: any
  std::vector<double> initial;       ///< numbers if the file does not give any
  bool any_size = false;             ///< the file may give another count of numbers
  double min = -kUnlimited;          ///< smallest number allowed
  double max = kUnlimited;           ///< largest number allowed

  SettingSpec& oneOf(const std::vector<std::string>& texts);  ///< sets the allowed texts
  SettingSpec& range(double smallest, double largest);        ///< sets min and max
  SettingSpec& anySize();                                     ///< allows any count of numbers
  SettingSpec& in(const std::string& units);                  ///< sets the unit
  SettingSpec& about(const std::string& words);               ///< sets the text
};

/// One number of a controller's inside that is worth watching, see FeedbackController::state().
struct StateSpec {
  std::string name;  ///< unique within the controller
  std::string unit;  ///< SI; "1" for a pure number; required
  std::string text;  ///< what it is; required

  StateSpec& in(const std::string& units);     ///< sets the unit
  StateSpec& about(const std::string& words);  ///< sets the text
};

/// The one declaration of a controller. The run-time checks, the schema of its configuration file,
/// plot(), its generated page and the template of its configuration all come from here.
struct Description {
  std::string type;        ///< name under which the class is registered
  std::string summary;     ///< one sentence
  std::string use;         ///< how to use it: what must be connected to what
  std::string when;        ///< when to apply it, and when not
  std::string limitations;  ///< what it does not do
  std::string law;          ///< the control law, in LaTeX
  std::string source;       ///< where the law comes from
  std::string information;  ///< anything else the developer wants to say; may be empty
  Stage stage = Stage::Task;  ///< where in the cycle it runs
  bool safety = false;  ///< true: refuses pause and disable unless they are forced
  SwitchPolicy on_switch = SwitchPolicy::Reset;  ///< when the motion controller changes
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

  /// What a manager needs to run the controller safely: names unique, sizes and ranges sensible,
  /// stage and modified containers in agreement. Empty if all is well, else one sentence each.
  std::vector<std::string> faults() const;

  /// What a reader needs: every text, unit and frame filled in. Empty if all is well, else one
  /// sentence per empty field. Tests fail on it.
  std::vector<std::string> emptyFields() const;
};

}  // namespace ctrl_more
