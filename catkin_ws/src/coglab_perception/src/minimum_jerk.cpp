#include "coglab_perception/minimum_jerk.hpp"

#include <algorithm>

namespace coglab_perception {

Transition transition(double remaining, double step) {
  const bool over = endsWithin(remaining, step);
  const double left = over ? 1.0 : remaining;
  const double x = over ? 1.0 : std::max(step, 0.0) / left;
  const double x2 = x * x, x3 = x2 * x, x4 = x2 * x2, x5 = x4 * x;
  // Quintic in x with the boundary values; each entry is the contribution of one boundary value or
  // its derivatives.
  const double way[] = {10 * x3 - 15 * x4 + 6 * x5, (30 * x2 - 60 * x3 + 30 * x4) / left,
                        (60 * x - 180 * x2 + 120 * x3) / (left * left)};
  Transition result;
  for (int order = 0; order < 3; ++order) {
    result(order, 0) = (order == 0 ? 1.0 : 0.0) - way[order];
    result(order, 3) = way[order];
  }
  result(0, 1) = (x - 6 * x3 + 8 * x4 - 3 * x5) * left;
  result(1, 1) = 1 - 18 * x2 + 32 * x3 - 15 * x4;
  result(2, 1) = (-36 * x + 96 * x2 - 60 * x3) / left;
  result(0, 2) = (0.5 * x2 - 1.5 * x3 + 1.5 * x4 - 0.5 * x5) * left * left;
  result(1, 2) = (x - 4.5 * x2 + 6 * x3 - 2.5 * x4) * left;
  result(2, 2) = 1 - 9 * x + 18 * x2 - 10 * x3;
  return result;
}

}  // namespace coglab_perception
