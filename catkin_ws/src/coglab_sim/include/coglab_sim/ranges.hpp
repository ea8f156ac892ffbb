/// @file
/// The ranges of parameter_table.inc, by name.
#pragma once

#include <string>
#include <type_traits>

#include <Eigen/Core>

namespace coglab_sim {

/// A closed interval, in the unit of the parameter.
struct Range {
  double low, high;

  bool holds(double value) const { return value >= low && value <= high; }
};

/// Range of a parameter of the cell, of cell_node or of a fault (`fault/…`). low == high if the
/// name is unknown or the parameter is not a number.
Range rangeOf(const std::string& name);

/// Throws std::invalid_argument "parameter <shown> = <value> is outside its range <low>..<high>"
/// if the value is outside the range.
void requireWithin(const Range& range, const std::string& shown, double value);
/// The same, with the range of the parameter `name`.
void requireWithin(const std::string& name, double value);

/// The same for a field of a row: checks a number, or each element of a vector, and accepts all
/// other types.
template <typename Field>
void requireFieldWithin(const Range& range, const std::string& name, const Field& field) {
  if constexpr (std::is_base_of_v<Eigen::MatrixBase<Field>, Field>) {
    for (Eigen::Index i = 0; i < field.size(); ++i)
      requireWithin(range, name + "[" + std::to_string(i) + "]", field[i]);
  } else if constexpr (std::is_arithmetic_v<Field> && !std::is_same_v<Field, bool>) {
    requireWithin(range, name, static_cast<double>(field));
  }
}

}  // namespace coglab_sim
