#include "coglab_sim/pace.hpp"

#include <algorithm>
#include <cstdio>

namespace coglab_sim {
namespace {

constexpr double kLateSteps = 0.3;    // share above which the computer is too busy
constexpr double kLostAnswers = 0.1;  // likewise; at 0.2 the controller leaves command mode
constexpr double kMissing = 0.3;      // likewise
constexpr double kSlowest = 0.25;     // of the wanted factor
constexpr int kPatienceMax = 60;      // s
constexpr int kTooEarly = 15;  // s; a raise was too early if a slowdown follows within this time

}  // namespace

bool ComputerLoad::tooBusy() const {
  return late_steps > kLateSteps || lost_answers > kLostAnswers || missing > kMissing;
}

Pace::Pace(double wanted) : wanted_(wanted), factor_(wanted) {}

double Pace::update(const ComputerLoad& load) {
  ++since_raised_;
  const bool now = load.tooBusy();
  busy_ = now ? busy_ + 1 : 0;
  good_ = now ? 0 : good_ + 1;
  if (busy_ >= kBusySeconds && wanted_ <= 1.0 && factor_ > kSlowest * wanted_) {
    if (since_raised_ <= kTooEarly) patience_ = std::min(2 * patience_, kPatienceMax);
    factor_ *= 0.5;
    busy_ = 0;
  } else if (good_ >= patience_ && factor_ < wanted_) {
    factor_ = std::min(wanted_, 2.0 * factor_);
    good_ = since_raised_ = 0;
  }
  return factor_;
}

std::string describe(const ComputerLoad& load, double factor, bool busy) {
  char text[400];
  const int size = std::snprintf(
      text, sizeof text,
      "%s: %.0f %% of the cell's steps late (limit %.0f %%), the latest by %.0f ms; %.0f %% of FRI "
      "answers late (limit %.0f %%); %.0f %% of the person's messages missing (limit %.0f %%). ",
      busy ? "This computer is too busy for real time" : "This computer keeps real time",
      100.0 * load.late_steps, 100.0 * kLateSteps, 1e3 * load.latest, 100.0 * load.lost_answers,
      100.0 * kLostAnswers, 100.0 * load.missing, 100.0 * kMissing);
  std::snprintf(text + size, sizeof text - static_cast<std::size_t>(size),
                "The simulated cell runs at %.3g of real time.", factor);
  return text;
}

}  // namespace coglab_sim
