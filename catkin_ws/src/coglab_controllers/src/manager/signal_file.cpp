#include "coglab_controllers/manager/signal_file.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "ctrl_more/log/words.hpp"

namespace coglab_controllers {
namespace {

using ctrl_more::ConfigNode;
using Parts = SignalField::Parts;

constexpr std::size_t kMostRows = 200;
constexpr int kLargestSignal = 1000;
constexpr double kLargestAge = 60.0, kHighestRate = 200.0;  // s, Hz

const std::vector<std::string> kXyz = {"x", "y", "z"};

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(' ');
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(' ') - first + 1);
}

std::vector<std::string> split(const std::string& text, char at, std::size_t most) {
  std::vector<std::string> parts(1);
  for (const char letter : text) {
    if (letter == at && parts.size() < most) {
      parts.emplace_back();
    } else {
      parts.back() += letter;
    }
  }
  for (std::string& part : parts) part = trimmed(part);
  return parts;
}

template <typename Items, typename NameOf>
std::vector<std::string> namesOf(const Items& items, NameOf name) {
  std::vector<std::string> names;
  for (const auto& item : items) names.push_back(name(item));
  return names;
}

const ConfigNode& required(const ConfigNode& row, const std::string& key) {
  if (const ConfigNode* node = row.find(key)) return *node;
  throw row.error("the row needs `" + key + "`");
}

std::string textOr(const ConfigNode& row, const std::string& key, const std::string& otherwise) {
  const ConfigNode* node = row.find(key);
  return node ? node->text(key) : otherwise;
}

double numberWithin(const ConfigNode& node, const std::string& key, double least, double most) {
  const double value = node.number(key);
  if (value >= least && value <= most) return value;
  std::string range = std::to_string(least) + " to " + std::to_string(most);
  throw node.error(key + " expects " + range + ", got " + std::to_string(value));
}

/// A graph name of ROS.
std::string topicOf(const ConfigNode& row) {
  const ConfigNode& node = required(row, "topic");
  const std::string& topic = node.text("topic");
  const auto allowed = [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '/'; };
  const bool begins = !topic.empty() && (std::isalpha(static_cast<unsigned char>(topic[0])) ||
                                         (topic[0] == '/' && topic.size() > 1));
  if (begins && topic.back() != '/' && topic.find("//") == std::string::npos &&
      std::all_of(topic.begin(), topic.end(), allowed)) {
    return topic;
  }
  throw node.error("'" + topic +
                   "' is no name of a topic; expected letters, digits, _ and / (without ~)");
}

/// Index of a name in a list. @throws ConfigError that suggests the nearest one
std::size_t indexOf(const ConfigNode& node, const std::string& what, const std::string& name,
                    const std::vector<std::string>& known) {
  const auto found = std::find(known.begin(), known.end(), name);
  if (found != known.end()) return static_cast<std::size_t>(found - known.begin());
  throw node.error("unknown " + what + " '" + name + "'" + ctrl_more::suggestion(name, known));
}

/// Reads `field` or `field[part, part]`.
SignalPick pickOf(const ConfigNode& node, const std::string& text, const SignalType& type) {
  const auto open = text.find('[');
  const std::string name = trimmed(text.substr(0, open));
  SignalPick pick;
  pick.field = indexOf(node, "field of " + type.name, name,
                       namesOf(type.fields, [](const SignalField& f) { return f.name; }));
  if (open == std::string::npos) return pick;
  if (text.back() != ']') throw node.error("'" + text + "' lacks a ] at its end");
  const SignalField& field = type.fields[pick.field];
  for (const std::string& part :
       split(text.substr(open + 1, text.size() - open - 2), ',', kLargestSignal)) {
    if (part.empty()) throw node.error("'" + text + "' names an empty part");
    if (field.kind == Parts::Joints) {
      pick.joints.push_back(part);
    } else if (field.kind == Parts::Fixed) {
      pick.parts.push_back(indexOf(node, "part of " + name, part, field.parts));
    } else {
      const bool digits = std::all_of(part.begin(), part.end(),
                                      [](unsigned char c) { return std::isdigit(c) != 0; });
      if (!digits || part.size() > 6) {
        throw node.error("'" + part + "' is no index of " + name + "; the first number has 0");
      }
      pick.parts.push_back(std::stoul(part));
    }
  }
  return pick;
}

/// Number of doubles of a pick; 0 if it depends on the message.
std::size_t sizeOf(const SignalPick& pick, const SignalField& field) {
  if (!pick.parts.empty()) return pick.parts.size();
  if (!pick.joints.empty()) return pick.joints.size();
  return field.parts.size();
}

void readFields(const ConfigNode& row, SignalInput& input) {
  const ConfigNode& node = required(row, "field");
  std::vector<std::string> fields;
  if (node.kind() == ConfigNode::Kind::List) {
    // YAML parses [position[a, b], velocity] as a list in a list; split the text instead.
    for (const ConfigNode& item : node.items()) fields.push_back(item.text("an element of field"));
  } else {
    fields.push_back(node.text("field"));
  }
  if (fields.empty()) throw node.error("field names no field");
  std::size_t size = 0;
  bool open = false;
  std::string unit;
  for (const std::string& text : fields) {
    const SignalPick pick = pickOf(node, text, *input.type);
    const SignalField& field = input.type->fields[pick.field];
    const std::size_t part = sizeOf(pick, field);
    open = open || part == 0;
    size += part;
    if (!field.unit.empty()) unit += (unit.empty() ? "" : ", ") + field.unit;
    input.picks.push_back(pick);
  }
  if (open && fields.size() > 1) {
    throw node.error(
        "a field without a fixed size stands alone, or with its parts: name[part, part]");
  }
  const ConfigNode* given = row.find("size");
  if (!given && open) throw row.error("the row needs `size`: the type does not fix it");
  if (given) {
    const double value = numberWithin(*given, "size", 1, kLargestSignal);
    if (value != std::floor(value)) throw given->error("size expects a whole number");
    input.size = static_cast<int>(value);
    if (!open && static_cast<std::size_t>(input.size) != size) {
      throw given->error("size is " + std::to_string(input.size) + ", but the fields have " +
                         std::to_string(size) + " numbers");
    }
  } else {
    input.size = static_cast<int>(size);
  }
  input.unit = textOr(row, "unit", unit);
}

SignalInput inputOf(const ConfigNode& row) {
  row.requireKeys("a row of `in`", {"topic", "type", "field", "key", "source", "size", "unit",
                                    "max_age", "frame", "stamp"});
  SignalInput input;
  input.place = row.place();
  input.topic = topicOf(row);
  const ConfigNode& type = required(row, "type");
  const std::vector<SignalType>& types = signalTypes();
  input.type = &types[indexOf(type, "type", type.text("type"),
                              namesOf(types, [](const SignalType& t) { return t.name; }))];
  readFields(row, input);
  input.key = required(row, "key").text("key");
  if (trimmed(input.key).empty()) throw row.error("key is empty");
  if (const ConfigNode* source = row.find("source")) {
    input.source = static_cast<ctrl_more::RobotSource>(
        indexOf(*source, "source", source->text("source"), {"measured", "estimated"}));
  }
  input.max_age = numberWithin(required(row, "max_age"), "max_age", 0.001, kLargestAge);
  input.frame = textOr(row, "frame", "");
  if (!input.frame.empty() && !input.type->stamped) {
    throw row.error("frame: " + input.type->name + " has no header with a frame");
  }
  const std::string stamp = textOr(row, "stamp", input.type->stamped ? "header" : "arrival");
  input.stamp_header = indexOf(row, "stamp", stamp, {"header", "arrival"}) == 0;
  if (input.stamp_header && !input.type->stamped) {
    throw row.error("stamp: header, but " + input.type->name + " has no header");
  }
  return input;
}

const std::vector<std::string> kOutTypes = {
    "geometry_msgs/PoseStamped", "geometry_msgs/TwistStamped", "geometry_msgs/WrenchStamped",
    "sensor_msgs/JointState", "std_msgs/Float64MultiArray"};

ctrl_more::ControlContainer containerOf(const ConfigNode& node, const std::string& name) {
  std::vector<std::string> known;
  for (int i = 0; i < ctrl_more::kControlContainers; ++i) {
    known.push_back(ctrl_more::nameOf(static_cast<ctrl_more::ControlContainer>(i)));
  }
  return static_cast<ctrl_more::ControlContainer>(indexOf(node, "container", name, known));
}

/// Refuses a type that cannot carry the value.
void checkType(const ConfigNode& node, const SignalOutput& out) {
  using Type = SignalOutput::Type;
  using Container = ctrl_more::ControlContainer;
  if (out.type == Type::Array) return;
  const bool reference = out.kind == SignalOutput::Kind::Reference;
  const int size = ctrl_more::fixedSizeOf(out.container);
  const bool fits = (out.type == Type::Pose && size == 7) ||
                    (out.type == Type::Joints && out.container == Container::JointSpaceReference) ||
                    ((out.type == Type::Twist || out.type == Type::Wrench) && size == 6);
  if (reference && fits) return;
  throw node.error("a " + kOutTypes[static_cast<std::size_t>(out.type)] +
                   " cannot carry this value; use std_msgs/Float64MultiArray");
}

SignalOutput outputOf(const ConfigNode& row) {
  row.requireKeys("a row of `out`", {"topic", "type", "value", "rate"});
  SignalOutput out;
  out.place = row.place();
  out.topic = topicOf(row);
  const ConfigNode& type = required(row, "type");
  out.type = static_cast<SignalOutput::Type>(indexOf(type, "type", type.text("type"), kOutTypes));
  const ConfigNode& value = required(row, "value");
  const std::string& text = value.text("value");
  std::vector<std::string> parts = split(text, '/', 4);
  const auto incomplete = [&](const char* form) {
    return value.error("'" + text + "': expected " + form);
  };
  if (parts[0] == "state") {
    parts = split(text, '/', 3);
    if (parts.size() < 2 || parts[1].empty()) throw incomplete("state/CONTROLLER[/STATE]");
    out.kind = SignalOutput::Kind::State;
    out.controller = parts[1];
    out.key = parts.size() > 2 ? parts[2] : "";
  } else {
    const bool correction = parts[0] == "correction";
    if (correction) {
      if (parts.size() != 4) throw incomplete("correction/CONTROLLER/CONTAINER/KEY");
      out.controller = parts[1];
      parts.erase(parts.begin(), parts.begin() + 2);
    }
    if (parts.size() != 2 || parts[1].empty()) {
      throw incomplete("CONTAINER/KEY, correction/... or state/...");
    }
    out.kind = correction ? SignalOutput::Kind::Correction : SignalOutput::Kind::Reference;
    out.container = containerOf(value, parts[0]);
    out.key = parts[1];
  }
  checkType(type, out);
  if (const ConfigNode* rate = row.find("rate")) {
    out.rate = numberWithin(*rate, "rate", 0.1, kHighestRate);
  }
  return out;
}

template <typename Row, typename Read>
void readRows(const ConfigNode& file, const char* section, std::vector<Row>& rows, Read read) {
  const ConfigNode* list = file.find(section);
  if (!list || list->kind() == ConfigNode::Kind::Empty) return;
  if (list->kind() != ConfigNode::Kind::List) {
    throw list->error(std::string("`") + section + ":` expects a list of rows, each after a dash");
  }
  if (list->items().size() > kMostRows) {
    throw list->error(std::string("`") + section + ":` has more than 200 rows");
  }
  for (const ConfigNode& item : list->items()) rows.push_back(read(item));
}

}  // namespace

const std::vector<SignalType>& signalTypes() {
  const auto joined = [](std::vector<std::string> first, const std::vector<std::string>& second,
                         const std::string& prefix) {
    for (const std::string& part : second) first.push_back(prefix + part);
    return first;
  };
  static const std::vector<std::string> quaternion = {"x", "y", "z", "w"};
  static const std::vector<std::string> fingers = [] {
    std::vector<std::string> parts;
    for (const char* finger : {"thumb", "index", "middle", "ring", "little", "palm"}) {
      for (const std::string& axis : kXyz) parts.push_back(finger + ("_" + axis));
    }
    return parts;
  }();
  static const std::vector<SignalType> types = {
      {"sensor_msgs/Imu",
       true,
       {{"orientation", quaternion, "1"},
        {"angular_velocity", kXyz, "rad/s"},
        {"linear_acceleration", kXyz, "m/s^2"}}},
      {"geometry_msgs/WrenchStamped",
       true,
       {{"force", kXyz, "N"},
        {"torque", kXyz, "Nm"},
        {"wrench", joined(kXyz, kXyz, "torque_"), "N, Nm"}}},
      {"geometry_msgs/PoseStamped",
       true,
       {{"position", kXyz, "m"},
        {"orientation", quaternion, "1"},
        {"pose", joined(kXyz, quaternion, "quaternion_"), "m, quaternion x y z w"}}},
      {"geometry_msgs/TwistStamped",
       true,
       {{"linear", kXyz, "m/s"},
        {"angular", kXyz, "rad/s"},
        {"twist", joined(kXyz, kXyz, "angular_"), "m/s, rad/s"}}},
      {"sensor_msgs/JointState",
       true,
       {{"position", {}, "rad", Parts::Joints},
        {"velocity", {}, "rad/s", Parts::Joints},
        {"effort", {}, "Nm", Parts::Joints}}},
      {"std_msgs/Float64MultiArray", false, {{"data", {}, "", Parts::Indices}}},
      {"coglab_msgs/FingertipForces", true, {{"forces", fingers, "N"}}},
  };
  return types;
}

const std::string& nameOf(SignalOutput::Type type) {
  return kOutTypes[static_cast<std::size_t>(type)];
}

void checkSignals(const SignalFile& all, const TopicRules& rules) {
  struct Use {
    std::string type, place;
    bool out;
  };
  std::map<std::string, std::string> writers;  // of a key, and where
  std::map<std::string, Use> topics;           // by their full names
  const auto check = [&](const std::string& place, const std::string& topic,
                         const std::string& type, bool out) {
    std::string name;
    try {
      name = rules.resolve ? rules.resolve(topic) : topic[0] == '/' ? topic : "/" + topic;
    } catch (const std::exception& error) {
      throw ctrl_more::ConfigError(place + ": topic " + topic + ": " + error.what());
    }
    const std::string called =
        place + ": topic " + topic + (topic == name ? "" : ", " + name + ",");
    const auto [other, first] = topics.insert({name, {type, place, out}});
    if (!first && (out || other->second.out)) {
      throw ctrl_more::ConfigError(called + " is in the row of " + other->second.place +
                                   " already; an output needs a topic of its own");
    }
    if (!first && other->second.type != type) {
      throw ctrl_more::ConfigError(called + " is a " + type + " here and a " + other->second.type +
                                   " in the row of " + other->second.place +
                                   "; a topic has one type");
    }
    const std::string refusal = rules.refusal ? rules.refusal(name, type, out) : "";
    if (!refusal.empty()) throw ctrl_more::ConfigError(called + " " + refusal);
  };
  for (const SignalInput& row : all.in) {
    const std::string key = std::string(ctrl_more::nameOf(row.source)) + "/" + row.key;
    const auto [other, first] = writers.insert({key, row.place});
    if (!first) {
      throw ctrl_more::ConfigError(row.place + ": two rows write " + key +
                                   ", the other one is that of " + other->second +
                                   "; give each a key of its own");
    }
    check(row.place, row.topic, row.type->name, false);
  }
  for (const SignalOutput& row : all.out) check(row.place, row.topic, nameOf(row.type), true);
}

SignalFile readSignals(const ConfigNode& file) {
  file.requireKeys("the file of signals", {"in", "out"});
  SignalFile result;
  readRows(file, "in", result.in, inputOf);
  readRows(file, "out", result.out, outputOf);
  checkSignals(result, {});
  return result;
}

SignalFile readSignalFile(const std::string& path) {
  return readSignals(ConfigNode::fromFile(path));
}

SignalInput touchSignal(const std::string& topic, const std::string& tool) {
  SignalInput input;
  input.place = "the hand's touch sensors";
  input.topic = topic;
  for (const SignalType& type : signalTypes()) {
    if (type.name == "coglab_msgs/FingertipForces") input.type = &type;
  }
  input.picks.resize(1);
  input.key = "touch";
  input.size = static_cast<int>(input.type->fields[0].parts.size());
  input.unit = "N";
  input.frame = tool;
  input.max_age = 0.5;
  return input;
}

}  // namespace coglab_controllers
