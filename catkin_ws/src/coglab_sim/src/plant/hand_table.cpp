#include "coglab_sim/plant/hand_table.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include <yaml-cpp/yaml.h>

namespace coglab_sim::plant {

extern const char* const kBuiltInHand;  // text of config/hand_model.yaml

namespace {

const std::array<const char*, kFingers> kFingerNames = {"thumb", "index", "middle", "ring",
                                                        "little"};

/// A map of the file, with the prefix of its error messages.
class Section {
 public:
  Section(YAML::Node node, std::string where) : node_(std::move(node)), where_(std::move(where)) {
    if (!node_.IsMap()) refuse("", "a map", "something else");
  }

  [[noreturn]] void refuse(const std::string& key, const std::string& expected,
                           const std::string& got) const {
    throw std::invalid_argument("hand table " + where_ + (key.empty() ? "" : "/" + key) +
                                ": expected " + expected + ", got " + got);
  }

  YAML::Node at(const std::string& key) const {
    const YAML::Node value = node_[key];
    if (!value) refuse(key, "a value", "nothing");
    return value;
  }

  std::string text(const std::string& key) const { return at(key).as<std::string>(); }

  double number(const std::string& key, double low, double high) const {
    return inRange(key, at(key), low, high);
  }

  std::vector<double> numbers(const std::string& key, std::size_t count, double low,
                              double high) const {
    const YAML::Node list = at(key);
    if (!list.IsSequence() || list.size() != count)
      refuse(key, "a list of " + std::to_string(count) + " numbers", "something else");
    std::vector<double> values;
    for (const auto& entry : list) values.push_back(inRange(key, entry, low, high));
    return values;
  }

  Vector3d vector(const std::string& key) const {
    const auto values = numbers(key, 3, -1.0, 1.0);
    return {values[0], values[1], values[2]};
  }

  Vector3d direction(const std::string& key) const {
    const Vector3d value = vector(key);
    if (std::abs(value.norm() - 1.0) > 1e-6) refuse(key, "a vector of length 1", "another length");
    return value;
  }

  Section section(const std::string& key) const { return {at(key), where_ + "/" + key}; }
  const std::string& where() const { return where_; }

 private:
  double inRange(const std::string& key, const YAML::Node& node, double low, double high) const {
    std::ostringstream range;
    range << "a number in " << low << ".." << high;
    double value = 0.0;
    if (!YAML::convert<double>::decode(node, value)) refuse(key, range.str(), "no number");
    if (!(value >= low && value <= high)) refuse(key, range.str(), std::to_string(value));
    return value;
  }

  YAML::Node node_;
  std::string where_;
};

Phalanx phalanxOf(const Section& row, Finger finger, bool first) {
  Phalanx phalanx;
  phalanx.name = row.text("name");
  phalanx.finger = finger;
  phalanx.first = first;
  phalanx.motor = static_cast<int>(row.number("motor", 0, kMotors - 1));
  phalanx.pivot = row.vector("pivot");
  phalanx.axis = row.direction("axis");
  phalanx.along = row.direction("along");
  const auto range = row.numbers("range", 2, -3.2, 3.2);
  phalanx.lower = range[0];
  phalanx.upper = range[1];
  if (phalanx.upper <= phalanx.lower) row.refuse("range", "low before high", "no range");
  phalanx.spring = row.number("spring", 0.0, 10.0);
  phalanx.arm = row.number("arm", 1e-4, 0.1);
  phalanx.length = row.number("length", 1e-3, 0.3);
  phalanx.radius = row.number("radius", 1e-3, 0.1);
  phalanx.mass = row.number("mass", 1e-4, 1.0);
  return phalanx;
}

void readPhalanges(const Section& table, HandTable& hand) {
  const Section fingers = table.section("fingers");
  for (int i = 0; i < kFingers; ++i) {
    const char* name = kFingerNames[static_cast<std::size_t>(i)];
    const YAML::Node rows = fingers.at(name);
    if (!rows.IsSequence() || rows.size() == 0)
      fingers.refuse(name, "a list of phalanges", "something else");
    bool first = true;
    for (std::size_t j = 0; j < rows.size(); ++j) {
      const Section row(rows[j], fingers.where() + "/" + name + "[" + std::to_string(j) + "]");
      hand.phalanges.push_back(phalanxOf(row, static_cast<Finger>(i), first));
      first = false;
    }
  }
}

void readMotors(const Section& table, HandTable& hand) {
  const YAML::Node rows = table.at("motors");
  if (!rows.IsSequence() || rows.size() != kMotors)
    table.refuse("motors", "a list of five", "something else");
  for (std::size_t i = 0; i < kMotors; ++i) {
    const Section row(rows[i], table.where() + "/motors[" + std::to_string(i) + "]");
    MotorRow& motor = hand.motors[i];
    motor.name = row.text("name");
    motor.limit = row.number("limit", 1.0, 1000.0);
    motor.both_ways = row.at("both_ways").as<bool>();
    for (const Phalanx& phalanx : hand.phalanges) {
      if (phalanx.motor != static_cast<int>(i)) continue;
      motor.stroke += phalanx.arm * (phalanx.upper - phalanx.lower);
      motor.open_length += phalanx.arm * phalanx.lower;
    }
    if (motor.stroke <= 0.0) row.refuse("name", "a motor that bends a phalanx", motor.name);
  }
}

HandTable tableOf(const YAML::Node& root, const std::string& where) {
  const Section table(root, where);
  HandTable hand;
  hand.palm = table.text("palm");
  const Section contact = table.section("contact"), joints = table.section("joints"),
                drive = table.section("drive");
  hand.sliding = contact.number("sliding", 0.0, 5.0);
  hand.torsional = contact.number("torsional", 0.0, 1.0);
  hand.rolling = contact.number("rolling", 0.0, 1.0);
  hand.joint_damping = joints.number("damping", 0.0, 10.0);
  hand.joint_armature = joints.number("armature", 1e-6, 1.0);
  readPhalanges(table, hand);
  readMotors(table, hand);
  hand.tendon_stiffness = table.number("tendon_stiffness", 100.0, 1e6);
  hand.full_stroke = drive.number("full_stroke", 0.01, 60.0);
  hand.lock_share = drive.number("lock_share", 0.0, 1.0);
  hand.lock_time = drive.number("lock_time", 0.001, 10.0);
  hand.free_current = drive.number("free_current", 0.0, 1023.0);
  hand.speed_current = drive.number("speed_current", 0.0, 1023.0);
  hand.stall_current = drive.number("stall_current", 1.0, 1023.0);
  return hand;
}

}  // namespace

double HandTable::phalangesMass() const {
  double mass = 0.0;
  for (const Phalanx& phalanx : phalanges) mass += phalanx.mass;
  return mass;
}

HandTable readHandTable(const std::string& path) {
  try {
    return tableOf(YAML::LoadFile(path), path);
  } catch (const YAML::Exception& error) {
    throw std::invalid_argument("hand table " + path + " cannot be read: " + error.what());
  }
}

const HandTable& builtInHandTable() {
  static const HandTable table = tableOf(YAML::Load(kBuiltInHand), "config/hand_model.yaml");
  return table;
}

}  // namespace coglab_sim::plant
