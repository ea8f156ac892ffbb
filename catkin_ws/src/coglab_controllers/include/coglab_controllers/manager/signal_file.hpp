/// @file
/// The file signals.yaml: which topics become robot signals of the feedback controllers, and which
/// of their references, corrections and states become topics. Without ROS.
///
///     in:
///       - topic: imu/data                 # relative to the namespace above the manager's
///         type: sensor_msgs/Imu
///         field: [orientation, angular_velocity, linear_acceleration]  # numbers are joined
///         key: hand_imu                   # name in RobotStates
///         source: measured                # or estimated; default: measured
///         size: 10                        # optional where the fields have a fixed size
///         unit: 1, rad/s, m/s^2           # default: that of the fields
///         max_age: 0.05                   # s; older values count as missing
///         frame: ih2_palm                 # optional: other frames are refused
///         stamp: header                   # or arrival; default: header if the type has one
///     out:
///       - topic: feedback/hand            # relative, as above
///         type: geometry_msgs/PoseStamped
///         value: taskSpaceReferencePose/ee   # after all controllers; or:
///                                         # correction/CONTROLLER/CONTAINER/KEY
///                                         # state/CONTROLLER or state/CONTROLLER/STATE
///         rate: 50                        # Hz, at most 200; default: 50
///
/// `field: name[part, part]` takes parts of a field: x y z w, joint names, or indices from 0.
/// Types and fields: signalTypes(). The file is read whole or not at all.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "ctrl_more/description/config_node.hpp"
#include "ctrl_more/states/signal.hpp"

namespace coglab_controllers {

/// A field of a message type that holds numbers.
struct SignalField {
  enum class Parts {
    Fixed,   ///< named in `parts`
    Joints,  ///< named by the message, as in JointState
    Indices  ///< as many as the message has
  };
  std::string name;
  std::vector<std::string> parts;  ///< if Fixed, in the order of the numbers
  std::string unit;
  Parts kind = Parts::Fixed;
};

/// A message type that can become a signal.
struct SignalType {
  std::string name;  ///< package/Type
  bool stamped;      ///< it has a header
  std::vector<SignalField> fields;
};

/// sensor_msgs/Imu: orientation (x y z w), angular_velocity, linear_acceleration.
/// geometry_msgs/WrenchStamped: force, torque, wrench. geometry_msgs/PoseStamped: position,
/// orientation, pose. geometry_msgs/TwistStamped: linear, angular, twist. sensor_msgs/JointState:
/// position, velocity, effort. std_msgs/Float64MultiArray: data. coglab_msgs/FingertipForces:
/// forces (thumb, index, middle, ring, little finger, palm; x y z each).
const std::vector<SignalType>& signalTypes();

/// The numbers that a row takes from one field.
struct SignalPick {
  std::size_t field = 0;            ///< index in the type
  std::vector<std::size_t> parts;   ///< indices; empty: see `joints`
  std::vector<std::string> joints;  ///< if also empty: the whole field
};

/// One row of `in`: a robot signal from a topic.
struct SignalInput {
  std::string place;  ///< file:line
  std::string topic;  ///< as in the file
  const SignalType* type = nullptr;
  std::vector<SignalPick> picks;
  std::string key;
  ctrl_more::RobotSource source = ctrl_more::RobotSource::Measured;
  int size = 0;
  std::string unit;
  std::string frame;         ///< required frame_id; empty: any
  double max_age = 0.1;      ///< s
  bool stamp_header = true;  ///< false: the time of arrival counts
};

/// One row of `out`: a topic from the feedback controllers.
struct SignalOutput {
  enum class Kind { Reference, Correction, State };
  enum class Type { Pose, Twist, Wrench, Joints, Array };
  std::string place;  ///< file:line
  std::string topic;  ///< as in the file
  Type type = Type::Array;
  Kind kind = Kind::Reference;
  std::string controller;  ///< of a correction or state
  ctrl_more::ControlContainer container = ctrl_more::ControlContainer::OtherReference;
  std::string key;     ///< of the reference, or name of a state; empty: all states
  double rate = 50.0;  ///< Hz
};

/// The message type of an output, package/Type.
const std::string& nameOf(SignalOutput::Type type);

/// Content of the file.
struct SignalFile {
  std::vector<SignalInput> in;
  std::vector<SignalOutput> out;
};

/// Rules of the host program for topics.
struct TopicRules {
  /// Returns the full name of a topic of the file, after remapping. May throw. If empty: "/" +
  /// name.
  std::function<std::string(const std::string& topic)> resolve;
  /// Returns why a row cannot have this topic (full name, type of the row, true: output), or an
  /// empty text. No function: every topic is allowed.
  std::function<std::string(const std::string& topic, const std::string& type, bool out)> refusal;
};

/// Checks all rows of one or more files together. Each key and each output has one row. A topic has
/// one type, is not both input and output, and is not used otherwise by the program.
/// @throws ctrl_more::ConfigError with file and line of the rows
void checkSignals(const SignalFile& all, const TopicRules& rules);

/// Reads a file. @throws ctrl_more::ConfigError with file, line, expected and actual value
SignalFile readSignalFile(const std::string& path);
/// As above, from a parsed file or text.
SignalFile readSignals(const ctrl_more::ConfigNode& file);

/// The row of touch sensors in the hand: `touch`, 18 numbers, N, axes of `tool`.
SignalInput touchSignal(const std::string& topic, const std::string& tool);

}  // namespace coglab_controllers
