#pragma once

#include <cstdint>
#include <limits>
#include <string>

namespace ctrl_more {

/// The two data maps of RobotStates (Ctrl-MORE paper, section IV-A).
enum class RobotSource : std::uint8_t {
  Measured,   ///< `measuredData`: sensors
  Estimated,  ///< `estimatedData`: results of other modules
};

/// The containers of ControlStates (Ctrl-MORE paper, section IV-B).
enum class ControlContainer : std::uint8_t {
  TaskSpaceReferencePose,  ///< 7: x y z [m], quaternion x y z w
  TaskSpaceReferenceVel,   ///< 6: linear [m/s], angular [rad/s]
  TaskSpaceReferenceAcc,   ///< 6: linear [m/s^2], angular [rad/s^2]
  JointSpaceReference,     ///< one per joint; keys Position, Velocity, Torque
  OtherReference,          ///< any declared size
  CentreOfMass,            ///< 3 each; keys com, comVelocity, comAcceleration
  LinearMomentum,          ///< 3 [kg m/s]; key linearMomentum
  AngularMomentum,         ///< 3 [kg m^2/s]; key angularMomentum
  Zmp,                     ///< 3 [m]; key zmp and user-defined keys
  PelvisOrientation,       ///< 4: unit quaternion x y z w; key pelvis
};

/// Number of sources.
constexpr int kRobotSources = 2;
/// Number of containers.
constexpr int kControlContainers = 10;

/// Rule for combining, fading and checking corrections of a signal.
enum class SignalKind : std::uint8_t {
  Vector,      ///< a correction is added
  Pose,        ///< 7: position adds, orientation multiplies from the left
  Quaternion,  ///< 4: x y z w, multiplies from the left
};

/// Common properties of the signals of one map or container.
struct SignalGroup {
  const char* name;                      ///< as in the paper
  SignalKind kind = SignalKind::Vector;  ///< algebra of corrections
  int size = 0;                          ///< size of every signal; 0: each key has its own
};

/// Common properties of the signals of a source.
const SignalGroup& groupOf(RobotSource source);
/// Common properties of the signals of a container.
const SignalGroup& groupOf(ControlContainer container);

/// Name of a source as in the paper: `measuredData`, `estimatedData`.
inline const char* nameOf(RobotSource source) { return groupOf(source).name; }
/// Name of a container as in the paper, for example `taskSpaceReferencePose`.
inline const char* nameOf(ControlContainer container) { return groupOf(container).name; }
/// Kind of the signals of a container.
inline SignalKind kindOf(ControlContainer container) { return groupOf(container).kind; }
/// Size of every signal of a container; 0 if each key has its own.
inline int fixedSizeOf(ControlContainer container) { return groupOf(container).size; }

/// Stamp of a signal that was never written. All other stamps are monotonic nanoseconds >= 0.
constexpr std::int64_t kNeverWritten = -1;

/// "No limit", for ages and corrections.
constexpr double kUnlimited = std::numeric_limits<double>::infinity();

/// Properties of one signal in a store.
struct SignalInfo {
  std::string key;                       ///< key within its map or container
  std::string unit;                      ///< SI unit or list of units; "" if not declared
  std::string frame;                     ///< frame of the numbers; "" if not declared
  std::uint32_t offset = 0;              ///< first double in the store's buffer
  std::uint32_t size = 0;                ///< number of doubles
  SignalKind kind = SignalKind::Vector;  ///< algebra of corrections
};

/// Handle of a signal, valid for every store with the same layout, including copies.
class Signal {
 public:
  /// An empty handle: no numbers.
  Signal() = default;
  /// Number of doubles.
  int size() const { return static_cast<int>(size_); }
  /// First double in the store's buffer.
  int offset() const { return static_cast<int>(offset_); }
  /// Row in the store's table.
  std::uint32_t index() const { return index_; }
  /// False for an empty handle.
  bool valid() const { return size_ != 0; }

 private:
  friend class SignalTable;
  std::uint32_t offset_ = 0;
  std::uint32_t size_ = 0;
  std::uint32_t index_ = 0;
};

/// Handle of a signal in RobotStates, for the host: RobotStates::find(). Controllers use Read<N>.
class RobotSignal : public Signal {
 public:
  RobotSignal() = default;

 private:
  friend class RobotStates;
  explicit RobotSignal(const Signal& signal) : Signal(signal) {}
};

/// Handle of a signal in ControlStates, for the host: ControlStates::find(). Controllers use
/// Reference<N> and Modify<N>.
class ControlSignal : public Signal {
 public:
  ControlSignal() = default;

 private:
  friend class ControlStates;
  explicit ControlSignal(const Signal& signal) : Signal(signal) {}
};

}  // namespace ctrl_more
