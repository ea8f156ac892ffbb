/// @file
/// Gains that may change while the control cycle uses them.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <deque>
#include <map>
#include <string>

#include "coglab_controllers/manager/parameters.hpp"
#include "coglab_controllers/names.hpp"

namespace coglab_controllers {

/// One number that may change at run time. Any thread sets it; the control cycle fades to it.
class Tunable {
 public:
  Tunable(std::string name, std::string text, double value, double least, double most)
      : name(std::move(name)),
        text(std::move(text)),
        least(least),
        most(most),
        wanted_(value),
        now_(value) {}

  const std::string name, text;  ///< the parameter's name, and a sentence with its unit
  const double least, most;      ///< range

  /// The last value set. Any thread, wait-free.
  double wanted() const noexcept { return wanted_.load(std::memory_order_relaxed); }
  /// Sets a value within the range. Any thread, wait-free.
  void set(double value) noexcept { wanted_.store(value, std::memory_order_relaxed); }

  /// The value for this cycle: it approaches the wanted one with a time constant of kFade, so that
  /// a velocity that depends on it makes no step. Control thread, once per cycle of `dt` s.
  double step(double dt) noexcept {
    const double wanted = this->wanted();
    now_ += std::min(1.0, dt / kFade) * (wanted - now_);
    if (std::abs(wanted - now_) < 1e-6 * (most - least)) now_ = wanted;
    return now_;
  }

 private:
  static constexpr double kFade = 0.1;  // s

  std::atomic<double> wanted_;
  double now_;  // control thread
};

/// The tunable gains of one controller. They are declared while the controller is configured.
class Tunables {
 public:
  /// Declares a gain; its first value is the parameter of the same name. The reference stays valid.
  /// @throws std::runtime_error as Parameters::number
  Tunable& add(const Parameters& parameters, const std::string& name, const std::string& text,
               double fallback, double least, double most) {
    return all_.emplace_back(name, text, parameters.number(name, fallback, least, most), least,
                             most);
  }

  const std::deque<Tunable>& all() const noexcept { return all_; }

  /// Sets all these gains, or none: an unknown name or a value out of range is refused.
  Answer set(const std::map<std::string, double>& values);

 private:
  std::deque<Tunable> all_;  // a Tunable does not move
};

}  // namespace coglab_controllers
