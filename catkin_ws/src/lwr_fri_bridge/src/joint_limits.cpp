#include "lwr_fri_bridge/joint_limits.hpp"

#include <cmath>
#include <stdexcept>
#include <vector>

#include <yaml-cpp/yaml.h>

namespace lwr_fri_bridge {
namespace {

const char* const kJointNames[7] = {"lwr_a1", "lwr_a2", "lwr_e1", "lwr_a3",
                                    "lwr_a4", "lwr_a5", "lwr_a6"};

[[noreturn]] void fail(const std::string& path, const YAML::Mark& mark, const std::string& what) {
  const std::string line = mark.is_null() ? "" : ":" + std::to_string(mark.line + 1);
  throw std::runtime_error("joint limits " + path + line + ": " + what);
}

/// Overwrites `value` if the section has the field; returns whether it had.
bool readVector(const std::string& path, const YAML::Node& section, const std::string& section_name,
                const std::string& field, bool positive, Vector7& value) {
  const YAML::Node node = section[field];
  const std::string name = section_name + "." + field;
  if (!node) return false;
  if (!node.IsSequence() || node.size() != 7) {
    fail(path, node.Mark(),
         name + ": expected a list of 7 numbers, got " +
             (node.IsSequence() ? std::to_string(node.size()) + " entries" : "no list"));
  }
  for (std::size_t i = 0; i < 7; ++i) {
    double number = 0.0;
    try {
      number = node[i].as<double>();
    } catch (const YAML::Exception&) {
      fail(path, node[i].Mark(), name + "[" + std::to_string(i) + "]: expected a number");
    }
    if (!std::isfinite(number) || (positive && number <= 0.0)) {
      fail(path, node[i].Mark(),
           name + "[" + std::to_string(i) + "] = " + std::to_string(number) + ": expected a " +
               (positive ? "positive " : "") + "finite number");
    }
    value[static_cast<Eigen::Index>(i)] = number;
  }
  return true;
}

/// Share by which the servos pass the speed that they are told; 0 if the table does not say.
double servoOvershoot(const std::string& path, const YAML::Node& root) {
  const YAML::Node node = root["servo_overshoot"];
  if (!node) return 0.0;
  double share = -1.0;
  try {
    share = node.as<double>();
  } catch (const YAML::Exception&) {
  }
  if (!(share >= 0.0 && share <= 0.5))
    fail(path, node.Mark(), "servo_overshoot: expected a number in 0..0.5");
  return share;
}

}  // namespace

JointLimits loadJointLimits(const std::string& path, const std::string& profile) {
  YAML::Node root;
  try {
    root = YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    throw std::runtime_error(
        "joint limits " + path +
        ": cannot be opened; expected lwr_description/config/joint_limits.yaml");
  } catch (const YAML::ParserException& error) {
    fail(path, error.mark, error.msg);
  }
  if (!root.IsMap())
    fail(path, root.Mark(), "expected a map with 'joints', 'default' and profiles");

  const YAML::Node joints = root["joints"];
  if (!joints || !joints.IsSequence() || joints.size() != 7) {
    fail(path, root.Mark(), "joints: expected the 7 names in wire order");
  }
  for (std::size_t i = 0; i < 7; ++i) {
    const auto name = joints[i].as<std::string>("");
    if (name != kJointNames[i]) {
      fail(path, joints[i].Mark(),
           "joints[" + std::to_string(i) + "] = '" + name + "': expected '" + kJointNames[i] + "'");
    }
  }

  struct Field {
    const char* name;
    Vector7 JointLimits::*member;
    bool positive;
  };
  const Field fields[] = {{"lower_position", &JointLimits::lower_position, false},
                          {"upper_position", &JointLimits::upper_position, false},
                          {"velocity", &JointLimits::velocity, true},
                          {"acceleration", &JointLimits::acceleration, true},
                          {"jerk", &JointLimits::jerk, true},
                          {"torque", &JointLimits::torque, true}};
  JointLimits limits;
  std::vector<std::string> sections = {"default"};
  if (profile != "default") sections.push_back(profile);
  for (const std::string& name : sections) {
    const YAML::Node section = root[name];
    if (!section || !section.IsMap()) fail(path, root.Mark(), "profile '" + name + "' is missing");
    for (const auto& entry : section) {
      bool known = false;
      for (const Field& field : fields)
        known = known || entry.first.as<std::string>() == field.name;
      if (!known)
        fail(path, entry.first.Mark(),
             name + "." + entry.first.as<std::string>() + ": unknown field");
    }
    for (const Field& field : fields) {
      const bool found =
          readVector(path, section, name, field.name, field.positive, limits.*field.member);
      if (!found && name == "default")
        fail(path, section.Mark(), "default." + std::string(field.name) + " is missing");
    }
  }
  const YAML::Node margin = root["position_margin"];
  limits.position_margin = margin && margin.IsScalar() ? margin.as<double>(-1.0) : -1.0;
  if (!(limits.position_margin >= 0.0 && limits.position_margin <= 0.5)) {
    fail(path, margin ? margin.Mark() : root.Mark(),
         "position_margin: expected a number from 0 to 0.5 (rad)");
  }
  for (int i = 0; i < 7; ++i) {
    if (limits.lower_position[i] >= limits.upper_position[i]) {
      fail(path, root.Mark(),
           std::string(kJointNames[i]) + ": lower_position must be below upper_position");
    }
  }
  limits.velocity /= 1.0 + servoOvershoot(path, root);
  return limits;
}

}  // namespace lwr_fri_bridge
