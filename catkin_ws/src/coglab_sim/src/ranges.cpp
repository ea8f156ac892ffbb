#include "coglab_sim/ranges.hpp"

#include <sstream>
#include <stdexcept>

namespace coglab_sim {

Range rangeOf(const std::string& name) {
  struct Row {
    const char* name;
    Range range;
  };
  static constexpr Row kRanges[] = {
#define ROW(type, field, value, name, low, high, ...) {name, {low, high}},
#define CELL ROW
#define KRC ROW
#define SERVOS ROW
#define DRIVES ROW
#define TORQUE_NOISE ROW
#define PALM_NOISE ROW
#define OBJECT ROW
#define PERSON ROW
#define SURROUNDINGS ROW
#define NODE ROW
#define FAULT(name, low, high) {name, {low, high}},
#include "coglab_sim/parameter_table.inc"
#undef ROW
  };
  for (const Row& row : kRanges) {
    if (name == row.name) return row.range;
  }
  return {0.0, 0.0};
}

void requireWithin(const Range& range, const std::string& shown, double value) {
  if (range.holds(value)) return;
  std::ostringstream text;
  text << "parameter " << shown << " = " << value << " is outside its range " << range.low << ".."
       << range.high;
  throw std::invalid_argument(text.str());
}

void requireWithin(const std::string& name, double value) {
  requireWithin(rangeOf(name), name, value);
}

}  // namespace coglab_sim
