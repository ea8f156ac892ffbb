/// @file
/// Reader of the table of joint limits, config/joint_limits.yaml in the package of an arm's
/// description. Not for real-time threads.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "coglab_rt/joint_limits.hpp"

namespace coglab_rt {

namespace detail {

/// A vector of the table: its name, its destination, whether its values must be positive, and its
/// largest possible absolute value. A number in degrees is larger than that.
struct LimitField {
  const char* name;
  Vector7 JointLimits::*member;
  bool positive;
  double most;
  const char* unit;
};
constexpr LimitField kLimitFields[] = {
    {"lower_position", &JointLimits::lower_position, false, 6.2832, "rad"},
    {"upper_position", &JointLimits::upper_position, false, 6.2832, "rad"},
    {"velocity", &JointLimits::velocity, true, 20.0, "rad/s"},
    {"acceleration", &JointLimits::acceleration, true, 200.0, "rad/s^2"},
    {"jerk", &JointLimits::jerk, true, 2e4, "rad/s^3"},
    {"torque", &JointLimits::torque, true, 2e3, "Nm"}};

[[noreturn]] inline void failTable(const std::string& path, const YAML::Mark& mark,
                                   const std::string& what) {
  const std::string line = mark.is_null() ? "" : ":" + std::to_string(mark.line + 1);
  throw std::runtime_error("joint limits " + path + line + ": " + what);
}

/// Overwrites `value` if the section has the field. Returns true if it has.
inline bool readLimitVector(const std::string& path, const YAML::Node& section,
                            const std::string& section_name, const LimitField& field,
                            Vector7& value) {
  const YAML::Node node = section[field.name];
  const std::string name = section_name + "." + field.name;
  if (!node) return false;
  if (!node.IsSequence() || node.size() != 7) {
    failTable(path, node.Mark(),
              name + ": expected a list of 7 numbers, got " +
                  (node.IsSequence() ? std::to_string(node.size()) + " entries" : "no list"));
  }
  for (std::size_t i = 0; i < 7; ++i) {
    double number = 0.0;
    try {
      number = node[i].as<double>();
    } catch (const YAML::Exception&) {
      failTable(path, node[i].Mark(), name + "[" + std::to_string(i) + "]: expected a number");
    }
    if (!std::isfinite(number) || (field.positive && number <= 0.0)) {
      failTable(path, node[i].Mark(),
                name + "[" + std::to_string(i) + "] = " + std::to_string(number) + ": expected a " +
                    (field.positive ? "positive " : "") + "finite number");
    }
    if (std::abs(number) > field.most) {
      failTable(path, node[i].Mark(),
                name + "[" + std::to_string(i) + "] = " + std::to_string(number) +
                    ": expected at most " + std::to_string(field.most) + " " + field.unit +
                    "; is it in degrees?");
    }
    value[static_cast<Eigen::Index>(i)] = number;
  }
  return true;
}

/// Reads one profile into `limits`; fields that are missing keep their values.
inline void readLimitProfile(const std::string& path, const YAML::Node& root,
                             const std::string& name, JointLimits& limits) {
  const YAML::Node section = root[name];
  if (!section || !section.IsMap())
    failTable(path, root.Mark(), "profile '" + name + "' is missing");
  for (const auto& entry : section) {
    bool known = false;
    for (const LimitField& field : kLimitFields)
      known = known || entry.first.as<std::string>() == field.name;
    if (!known)
      failTable(path, entry.first.Mark(),
                name + "." + entry.first.as<std::string>() + ": unknown field");
  }
  for (const LimitField& field : kLimitFields) {
    const bool found = readLimitVector(path, section, name, field, limits.*field.member);
    if (!found && name == "default")
      failTable(path, section.Mark(), "default." + std::string(field.name) + " is missing");
  }
}

/// The table as YAML.
inline YAML::Node openLimitsTable(const std::string& path) {
  YAML::Node root;
  try {
    root = YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    throw std::runtime_error(
        "joint limits " + path +
        ": cannot be opened; expected config/joint_limits.yaml of the arm's description");
  } catch (const YAML::ParserException& error) {
    failTable(path, error.mark, error.msg);
  }
  if (!root.IsMap())
    failTable(path, root.Mark(), "expected a map with 'joints', 'default' and profiles");
  return root;
}

/// Names of the joints. The back end checks whether they belong to its arm.
inline std::array<std::string, 7> jointNames(const std::string& path, const YAML::Node& root) {
  const YAML::Node joints = root["joints"];
  if (!joints || !joints.IsSequence() || joints.size() != 7)
    failTable(path, root.Mark(), "joints: expected the 7 names in the order of the arm");
  std::array<std::string, 7> names;
  for (std::size_t i = 0; i < 7; ++i) {
    const auto name = joints[i].as<std::string>("");
    if (name.empty() || std::count(names.begin(), names.end(), name) != 0) {
      failTable(path, joints[i].Mark(),
                "joints[" + std::to_string(i) + "] = '" + name +
                    "': expected a name that no other joint has");
    }
    names[i] = name;
  }
  return names;
}

/// Share by which the servos exceed their commanded speed; 0 if the table does not contain it.
inline double servoOvershoot(const std::string& path, const YAML::Node& root) {
  const YAML::Node node = root["servo_overshoot"];
  if (!node) return 0.0;
  double share = -1.0;
  try {
    share = node.as<double>();
  } catch (const YAML::Exception&) {
  }
  if (!(share >= 0.0 && share <= 0.5))
    failTable(path, node.Mark(), "servo_overshoot: expected a number in 0..0.5");
  return share;
}

/// True if the file declares that its limits may be wider than those of the arm's own table.
inline bool mayBeWider(const std::string& path, const YAML::Node& root) {
  const YAML::Node node = root["wider_than_robot"];
  bool wider = false;
  if (node && !YAML::convert<bool>::decode(node, wider))
    failTable(path, node.Mark(), "wider_than_robot: expected true or false");
  return wider;
}

/// @throws std::runtime_error naming the field if a limit is wider than that of the arm.
inline void requireWithin(const std::string& path, const JointLimits& limits,
                          const std::string& own_path, const JointLimits& own) {
  const auto compare = [&](const std::string& field, double value, double allowed, double excess) {
    if (excess <= 1e-9) return;
    throw std::runtime_error("joint limits " + path + ": " + field + " = " + std::to_string(value) +
                             " is wider than the robot's own " + std::to_string(allowed) + " (" +
                             own_path +
                             "); narrow it, or add the line 'wider_than_robot: true' to the file");
  };
  for (const LimitField& field : kLimitFields) {
    for (int i = 0; i < 7; ++i) {
      const double value = (limits.*field.member)[i], allowed = (own.*field.member)[i];
      const bool lower = field.member == &JointLimits::lower_position;
      compare(std::string(field.name) + "[" + std::to_string(i) + "]", value, allowed,
              lower ? allowed - value : value - allowed);
    }
  }
  compare("position_margin", limits.position_margin, own.position_margin,
          own.position_margin - limits.position_margin);
}

}  // namespace detail

/// Reads the table. `profile` is "default" or a profile of the file such as "t1", which overrides
/// the fields that it contains. `own_path`: table of the arm itself; empty: none. A limit that is
/// wider than in that table is refused unless the file has the line `wider_than_robot: true`.
/// @throws std::runtime_error naming file, line, field and the expected value if anything is
/// missing, of the wrong length, not finite, out of range or out of order.
inline JointLimits loadJointLimits(const std::string& path, const std::string& profile = "default",
                                   const std::string& own_path = "") {
  const YAML::Node root = detail::openLimitsTable(path);
  JointLimits limits;
  limits.names = detail::jointNames(path, root);
  detail::readLimitProfile(path, root, "default", limits);
  if (profile != "default") detail::readLimitProfile(path, root, profile, limits);
  const YAML::Node margin = root["position_margin"];
  limits.position_margin = margin && margin.IsScalar() ? margin.as<double>(-1.0) : -1.0;
  if (!(limits.position_margin >= 0.0 && limits.position_margin <= 0.5)) {
    detail::failTable(path, margin ? margin.Mark() : root.Mark(),
                      "position_margin: expected a number from 0 to 0.5 (rad)");
  }
  for (int i = 0; i < 7; ++i) {
    if (limits.lower_position[i] >= limits.upper_position[i]) {
      detail::failTable(path, root.Mark(),
                        limits.names[static_cast<std::size_t>(i)] +
                            ": lower_position must be below upper_position");
    }
  }
  limits.velocity /= 1.0 + detail::servoOvershoot(path, root);
  if (!detail::mayBeWider(path, root) && !own_path.empty())
    detail::requireWithin(path, limits, own_path, loadJointLimits(own_path));
  return limits;
}

}  // namespace coglab_rt
