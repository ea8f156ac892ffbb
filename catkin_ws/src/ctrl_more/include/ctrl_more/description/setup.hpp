#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ctrl_more/description/configuration.hpp"
#include "ctrl_more/description/description.hpp"
#include "ctrl_more/states/control_states.hpp"
#include "ctrl_more/states/handles.hpp"
#include "ctrl_more/states/robot_states.hpp"
#include "ctrl_more/states/signal.hpp"

namespace ctrl_more {

/// One declared signal of a controller with its resolved key and handle.
template <typename Use, typename Handle>
struct ResolvedUse {
  Use use;             ///< the declaration
  std::string key;     ///< the key after settings
  Handle signal = {};  ///< handle; empty until it is resolved
};

/// One declared robot signal.
struct ResolvedRobotUse : ResolvedUse<RobotSignalUse, RobotSignal> {
  /// `map/key`.
  std::string name() const { return nameOf(use.source) + ("/" + key); }
};

/// One declared control signal.
struct ResolvedControlUse : ResolvedUse<ControlSignalUse, ControlSignal> {
  /// `container/key`.
  std::string name() const { return nameOf(use.container) + ("/" + key); }
};

/// Argument of initialize(). It returns the configuration, and handles of declared signals. A
/// request for an undeclared signal, or with another size, throws std::invalid_argument. The
/// controller is then refused with that sentence. Keys that do not exist yet are added with the
/// declared size, until the stores are frozen.
class Setup {
 public:
  /// Made by the manager.
  /// @param name name of the controller, for messages
  /// @param description its declaration
  /// @param gains its gains
  /// @param settings its settings
  /// @param robot shared robot states
  /// @param control shared control states
  /// @param owner the controller's number
  Setup(std::string name, const Description& description, const GainValues& gains,
        const SettingValues& settings, RobotStates& robot, ControlStates& control,
        std::uint32_t owner);

  /// Handle of a declared robot signal of N numbers.
  /// @param role its name in the description
  /// @param size expected size of a Read<AnySize>; 0: the declared size (if the description allows
  ///        several sizes: the size of the existing key)
  template <int N = AnySize>
  Read<N> read(const std::string& role, int size = 0) {
    return Read<N>(robotSignal(role, N == AnySize ? size : N));
  }

  /// Handle of a declared control signal of N numbers, for reading.
  /// @param role its name in the description, or `container/role` if a role appears twice
  /// @param size as in read()
  template <int N = AnySize>
  Reference<N> reference(const std::string& role, int size = 0) {
    return Reference<N>(controlSignal(role, N == AnySize ? size : N, false));
  }

  /// Permission to modify a control signal of N numbers that the description declares as modified.
  /// @param role its name in the description, or `container/role` if a role appears twice
  /// @param size as in read()
  template <int N = AnySize>
  Modify<N> modify(const std::string& role, int size = 0) {
    return Modify<N>(controlSignal(role, N == AnySize ? size : N, true), owner_);
  }

  /// Handle of a declared gain.
  Gain gain(const std::string& name) const { return gains_.find(name); }

  /// Value of a declared text setting.
  const std::string& text(const std::string& name) const { return settings_.text(name); }

  /// Value of a declared numeric setting.
  const std::vector<double>& numbers(const std::string& name) const {
    return settings_.numbers(name);
  }

  /// Number of joints of the control states, 0 if undecided.
  int joints() const { return control_.joints(); }

  /// Nominal control period [s]. Cycle::dt is the true one of each cycle.
  double period() const { return control_.controlPeriod(); }

  /// Resolves the declared signals that initialize() did not request. Drops those with ifAsked().
  /// Called by the manager after initialize().
  void resolveAll();

  /// All declared robot signals, in order of declaration; complete after resolveAll().
  const std::vector<ResolvedRobotUse>& robotUses() const { return robot_uses_; }

  /// All declared control signals, in order of declaration; complete after resolveAll().
  const std::vector<ResolvedControlUse>& controlUses() const { return control_uses_; }

 private:
  RobotSignal robotSignal(const std::string& role, int size);
  ControlSignal controlSignal(const std::string& role, int size, bool to_modify);
  void resolve(ResolvedRobotUse& entry, int size);
  void resolve(ResolvedControlUse& entry, int size);
  template <typename Entry, typename Store, typename Group>
  void resolveIn(Store& store, Group group, Entry& entry, const std::vector<int>& allowed,
                 int size);
  ResolvedControlUse& findControl(const std::string& role);
  std::string keyOf(const std::string& role, const std::string& key_setting) const;

  std::string name_;
  const GainValues& gains_;
  const SettingValues& settings_;
  RobotStates& robot_;
  ControlStates& control_;
  std::uint32_t owner_;
  std::vector<ResolvedRobotUse> robot_uses_;
  std::vector<ResolvedControlUse> control_uses_;
};

}  // namespace ctrl_more
