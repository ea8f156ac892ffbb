/// @file
/// The one table of ranges: what the simulated cell can compute with, not what is sensible.
#pragma once

#include <string>

namespace coglab_sim {

/// A closed interval, in the unit of the parameter.
struct Range {
  double low, high;

  bool holds(double value) const { return value >= low && value <= high; }
};

/// Range of a parameter by its name in cellParameters(), of a parameter of the node, or of a
/// fault's value (`fault/…`); low == high if it is none of those, or no number.
Range rangeOf(const std::string& name);

/// Throws std::invalid_argument "parameter <shown> = <value> is outside its range <low>..<high>"
/// unless the range holds it.
void requireWithin(const Range& range, const std::string& shown, double value);
/// The same with the range of that name.
void requireWithin(const std::string& name, double value);

}  // namespace coglab_sim
