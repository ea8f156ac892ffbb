#include "cell_parameters.hpp"

#include <ros/package.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "coglab_rt/ros/parameter.hpp"
#include "coglab_sim/ranges.hpp"

namespace coglab_sim {
namespace {

/// Description of the expected value.
template <typename T>
constexpr const char* expected() {
  if constexpr (std::is_same_v<T, bool>) return "true or false";
  if constexpr (std::is_same_v<T, std::string>) return "a text";
  if constexpr (std::is_same_v<T, std::vector<double>>) return "a list of numbers";
  return "a number";
}

/// Sets a row of the table from the node's parameter `key`, if it exists, converted to the row's
/// type. @throws std::invalid_argument naming parameter, value and range.
void take(CellConfig& config, const ros::NodeHandle& node, const CellParameter& row,
          const std::string& key) {
  if (!node.hasParam(key)) return;
  const auto read = [&](const auto& otherwise) -> ParameterValue {
    using T = std::decay_t<decltype(otherwise)>;
    return coglab_rt::readParameter<T>(node, key.c_str(), otherwise, expected<T>());
  };
  row.set(config, std::visit(read, row.get(config)));
}

/// Reads a number within the range of the schema. @throws std::invalid_argument naming the field.
double numberOf(const YAML::Node& entry, const std::string& field, const YAML::Node& schema) {
  const auto value = entry.as<double>(std::nan(""));
  if (!std::isfinite(value)) throw std::invalid_argument(field + ": expected a number");
  requireWithin({schema["minimum"].as<double>(), schema["maximum"].as<double>()}, field, value);
  return value;
}

/// Box around a shape that has its own lengths. @throws std::invalid_argument with both sizes if
/// `size` differs from the shape's, like the database.
void requireSolid(const YAML::Node& shape, const YAML::Node& length,
                  const std::vector<double>& size) {
  constexpr double kSame = 1e-6;  // m, rounding error
  const auto type = shape["type"].as<std::string>();
  if (type != "cylinder" && type != "sphere") return;
  const double radius = numberOf(shape["radius"], "shape.radius", length);
  const double height =
      type == "sphere" ? 2.0 * radius : numberOf(shape["height"], "shape.height", length);
  const std::vector<double> around{2.0 * radius, 2.0 * radius, height};
  const auto same = [&](double a, double b) { return std::abs(a - b) <= kSame; };
  if (size.size() == around.size() && std::equal(size.begin(), size.end(), around.begin(), same))
    return;
  std::ostringstream text;
  text << "size: a " << type << " of radius " << radius;
  if (type == "cylinder") text << " and height " << height;
  text << " is [";
  for (std::size_t i = 0; i < around.size(); ++i) text << (i == 0 ? "" : ", ") << around[i];
  text << "], got [";
  for (std::size_t i = 0; i < size.size(); ++i) text << (i == 0 ? "" : ", ") << size[i];
  text << "]; size is the box around the shape, m";
  throw std::invalid_argument(text.str());
}

/// Mass, size, shape and friction of an entry, within the same ranges as in the database.
plant::Object objectOf(const YAML::Node& entry) {
  const YAML::Node schema =
      YAML::LoadFile(ros::package::getPath("coglab_objects") + "/config/object_schema.json");
  const YAML::Node fields = schema["properties"], length = schema["definitions"]["length"];
  std::vector<double> size;
  for (const YAML::Node& side : entry["size"]) size.push_back(numberOf(side, "size", length));
  requireSolid(entry["shape"], length, size);
  CellConfig config;
  setCellParameter(config, "object/mass", numberOf(entry["mass"], "mass", fields["mass"]));
  setCellParameter(config, "object/friction",
                   numberOf(entry["friction"], "friction", fields["friction"]));
  setCellParameter(config, "object/shape", entry["shape"]["type"].as<std::string>());
  setCellParameter(config, "object/size", size);
  config.object.center = Vector3d(0.0, 0.0, config.object.size[2] / 2);
  return config.object;
}

}  // namespace

CellConfig readCellConfig(const ros::NodeHandle& node) {
  CellConfig config;
  config.urdf = ros::package::getPath("lwr_description") + "/urdf/lwr_ih2.urdf";
  const ros::NodeHandle above;
  config.object =
      readObject(node, coglab_rt::readParameter(node, "object/id", config.object.id, "a name"));
  config.object_position[2] = -config.object.center[2];  // held at its middle
  for (const CellParameter& row : cellParameters()) {
    if (row.name == "krc/period") take(config, above, row, "fri_period");
    if (row.name == "seed") take(config, above, row, "seed");
    take(config, node, row, row.name);
  }
  return config;
}

plant::Object readObject(const ros::NodeHandle& node, const std::string& id) {
  if (id.find('/') != std::string::npos)
    throw std::invalid_argument("object id '" + id + "': expected the name of an object file");
  const auto folder = coglab_rt::readParameter<std::string>(
      node, "objects", ros::package::getPath("coglab_objects") + "/objects", "a path");
  const std::string path = folder + "/" + id + ".yaml";
  try {
    plant::Object object = objectOf(YAML::LoadFile(path));
    object.id = id;
    return object;
  } catch (const std::exception& error) {
    throw std::invalid_argument(
        "object '" + id + "': " + path + " cannot be used (" + error.what() +
        "); expected a file of the object database, ./coglab object check " + id);
  }
}

}  // namespace coglab_sim
