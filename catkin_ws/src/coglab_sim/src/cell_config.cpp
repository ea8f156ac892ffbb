#include "coglab_sim/cell_config.hpp"

#include <cmath>
#include <stdexcept>

#include "coglab_sim/krc/krl_program.hpp"
#include "coglab_sim/ranges.hpp"

namespace coglab_sim {
namespace {

using krc::KrlConvention;
using krc::OperatingMode;

constexpr std::pair<OperatingMode, const char*> kModes[] = {
    {OperatingMode::T1, "T1"}, {OperatingMode::T2, "T2"}, {OperatingMode::Automatic, "AUT"}};

[[noreturn]] void refuse(const std::string& name, const std::string& expected) {
  throw std::invalid_argument("parameter " + name + ": expected " + expected);
}

/// Converts a value to the parameter's type. Throws with the expected type.
template <typename T>
const T& valueAs(const std::string& name, const ParameterValue& value, const char* expected) {
  const T* given = std::get_if<T>(&value);
  if (given == nullptr) refuse(name, expected);
  return *given;
}

template <typename Vector>
Vector vectorOf(const std::string& name, const ParameterValue& value) {
  const auto* list = std::get_if<std::vector<double>>(&value);
  const auto size = static_cast<std::size_t>(Vector::SizeAtCompileTime);
  if (list == nullptr || list->size() != size)
    refuse(name, "a list of " + std::to_string(size) + " numbers");
  return Eigen::Map<const Vector>(list->data());
}

// Read and write access to each type of field.
template <typename Field>
ParameterValue read(const Field& field) {
  if constexpr (std::is_same_v<Field, Vector7> || std::is_same_v<Field, Vector3d>) {
    return std::vector<double>(field.data(), field.data() + field.size());
  } else if constexpr (std::is_same_v<Field, Quaterniond>) {
    return std::vector<double>{field.x(), field.y(), field.z(), field.w()};
  } else if constexpr (std::is_same_v<Field, std::uint64_t>) {
    return static_cast<int>(field);
  } else if constexpr (std::is_same_v<Field, KrlConvention>) {
    return krc::nameOf(field);
  } else if constexpr (std::is_same_v<Field, OperatingMode>) {
    return std::string(kModes[static_cast<int>(field)].second);
  } else {
    return field;
  }
}

template <typename Field>
void write(Field& field, const std::string& name, const Range& range, const ParameterValue& value) {
  if constexpr (std::is_same_v<Field, Vector7> || std::is_same_v<Field, Vector3d>) {
    const auto list = vectorOf<Field>(name, value);
    requireFieldWithin(range, name, list);
    field = list;
  } else if constexpr (std::is_same_v<Field, Quaterniond>) {
    const auto q = vectorOf<Eigen::Vector4d>(name, value);
    requireFieldWithin(range, name, q);
    if (std::abs(q.norm() - 1.0) > 1e-3) refuse(name, "a quaternion x y z w of length 1");
    field = Quaterniond(q[3], q[0], q[1], q[2]).normalized();
  } else if constexpr (std::is_same_v<Field, std::string>) {
    field = valueAs<std::string>(name, value, "a text");
  } else if constexpr (std::is_same_v<Field, bool>) {
    field = valueAs<bool>(name, value, "true or false");
  } else if constexpr (std::is_same_v<Field, KrlConvention>) {
    field = krc::krlConventionOf(valueAs<std::string>(name, value, "a text"));
  } else if constexpr (std::is_same_v<Field, OperatingMode>) {
    const auto& text = valueAs<std::string>(name, value, "a text");
    for (const auto& [mode, known] : kModes) {
      if (text == known) {
        field = mode;
        return;
      }
    }
    refuse(name, "T1, T2 or AUT, got " + text);
  } else {
    const auto* whole = std::get_if<int>(&value);
    const double number = whole != nullptr ? *whole : valueAs<double>(name, value, "a number");
    requireWithin(range, name, number);
    field = static_cast<Field>(number);
  }
}

/// One row; `field` returns a reference to its value in the configuration.
template <typename Access>
CellParameter row(Access field, bool node_only, const char* name, double low, double high,
                  const char* unit, const char* source, const char* text) {
  const auto get = [field](const CellConfig& config) { return read(field(config)); };
  const auto set = [=](CellConfig& config, const ParameterValue& value) {
    write(field(config), name, {low, high}, value);
  };
  return {name, unit, source, text, low, high, node_only, get, set};
}

std::vector<CellParameter> makeTable() {
  return {
#define FIELD(path) \
  [](auto& config) -> auto& { return config.path; }
#define CELL(type, field, value, ...) row(FIELD(field), false, __VA_ARGS__),
#define KRC(type, field, value, ...) row(FIELD(krc.field), false, __VA_ARGS__),
#define SERVOS(type, field, value, ...) row(FIELD(servos.field), false, __VA_ARGS__),
#define DRIVES(type, field, value, ...) row(FIELD(drives.field), false, __VA_ARGS__),
#define TORQUE_NOISE(type, field, value, ...) row(FIELD(torque_noise.field), false, __VA_ARGS__),
#define PALM_NOISE(type, field, value, ...) row(FIELD(palm_noise.field), false, __VA_ARGS__),
#define OBJECT(type, field, value, ...) row(FIELD(object.field), false, __VA_ARGS__),
#define PERSON(type, field, value, ...) row(FIELD(person.field), false, __VA_ARGS__),
#define SURROUNDINGS(type, field, value, ...) row(FIELD(surroundings.field), false, __VA_ARGS__),
#define NODE(type, field, value, ...) row(FIELD(node.field), true, __VA_ARGS__),
#include "coglab_sim/parameter_table.inc"
#undef FIELD
  };
}

}  // namespace

const std::vector<CellParameter>& cellParameters() {
  static const std::vector<CellParameter> table = makeTable();
  return table;
}

void setCellParameter(CellConfig& config, const std::string& name, const ParameterValue& value) {
  for (const auto& parameter : cellParameters()) {
    if (parameter.name != name || parameter.node_only) continue;
    parameter.set(config, value);
    return;
  }
  throw std::invalid_argument("the simulated cell has no parameter '" + name + "'");
}

}  // namespace coglab_sim
