/// @file
/// What every KRL program of the stand-in does: open FRI once, open the brakes, wait for a quality,
/// start.
#pragma once

#include "coglab_sim/krc/krl_program.hpp"

namespace coglab_sim::krc {

inline bool isStrategy(std::int32_t value) { return value == 10 || value == 20 || value == 30; }

/// The part every program shares: open FRI once, open the brakes, wait for a quality, start.
class StartSequence {
 public:
  enum class Outcome { Working, Started, NoDrives, PoorQuality, NotEntered };

  void begin() {
    waited_ = 0.0;
    nudged_ = false;
  }

  /// One poll; `wait` receives the time until the next one. Working until the outcome is known.
  Outcome poll(KrlInterface& krl, lwr_fri_bridge::fri::Quality needed, double& wait) {
    wait = krl.parameters().krl_poll;
    waited_ += wait;
    if (!krl.drivesReady()) {
      if (waited_ > krl.parameters().krl_drive_wait) return Outcome::NoDrives;
      if (!nudged_) krl.nudge();
      nudged_ = true;
      return Outcome::Working;
    }
    if (krl.quality() < needed)
      return waited_ > krl.parameters().krl_quality_wait ? Outcome::PoorQuality : Outcome::Working;
    return krl.friStart(1.0) == lwr_fri_bridge::fri::FriState::Command ? Outcome::Started
                                                                       : Outcome::NotEntered;
  }

 private:
  double waited_ = 0.0;
  bool nudged_ = false;
};

/// Opens FRI and the brakes, then does what the convention does.
class BasicProgram : public KrlProgram {
 public:
  double poll(KrlInterface& krl) final {
    if (!opened_) {
      krl.friOpen(0.0);
      krl.nudge();
      opened_ = true;
      begin(krl);
      return krl.parameters().krl_poll;
    }
    return run(krl);
  }

 protected:
  virtual void begin(KrlInterface&) {}
  virtual double run(KrlInterface& krl) = 0;

  StartSequence sequence_;
  bool starting_ = false;

 private:
  bool opened_ = false;
};

/// The program of OpenKC.
std::unique_ptr<KrlProgram> makeOpenKc();

}  // namespace coglab_sim::krc
