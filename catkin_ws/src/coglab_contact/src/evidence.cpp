#include "coglab_contact/evidence.hpp"

#include <algorithm>
#include <cmath>

namespace coglab_contact {

double probability(double margin) {
  const double logits = std::log(kDecided / (1.0 - kDecided)) + kSteepness * (margin - 1.0);
  return 1.0 / (1.0 + std::exp(-std::min(60.0, logits)));
}

}  // namespace coglab_contact
