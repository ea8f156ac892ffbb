#include "coglab_sim/krc/krl_program.hpp"

#include <array>
#include <stdexcept>

namespace coglab_sim::krc {

using lwr_fri_bridge::fri::FriState;
using lwr_fri_bridge::fri::Quality;

namespace {

constexpr std::array<const char*, 7> kNames = {
    "coglab", "centro_epiaggio", "stanford", "rcprg_tum", "rtt_lwr", "openkc", "kuka_sample"};

bool isStrategy(std::int32_t value) { return value == 10 || value == 20 || value == 30; }

/// Common part of all programs: open FRI once, open the brakes, wait for a quality, start.
class StartSequence {
 public:
  enum class Outcome { Working, Started, NoDrives, PoorQuality, NotEntered };

  void begin() {
    waited_ = 0.0;
    nudged_ = false;
  }

  /// One poll; sets `wait` to the time until the next one. Returns Working until the outcome is
  /// known.
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

/// Opens FRI and the brakes, then runs the convention.
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

/// Our own program (lwr_fri_bridge/krl): numbered requests, numbered results.
class Coglab : public BasicProgram {
 protected:
  void begin(KrlInterface& krl) override {
    done_ = krl.frmInt(3);  // ignore the value of an earlier run
    krl.setToInt(1, done_);
    krl.setToInt(16, 4010);
  }

  double run(KrlInterface& krl) override {
    double wait = krl.parameters().krl_poll;
    const std::int32_t number = krl.frmInt(3);
    if (starting_) {
      switch (sequence_.poll(krl, Quality::Perfect, wait)) {
        case StartSequence::Outcome::Working:
          return wait;
        case StartSequence::Outcome::Started:
          finish(krl, 1);
          break;
        case StartSequence::Outcome::NoDrives:
          finish(krl, -4);
          break;
        case StartSequence::Outcome::PoorQuality:
          finish(krl, -2);
          break;
        case StartSequence::Outcome::NotEntered:
          finish(krl, -3);
          break;
      }
      return wait;
    }
    if (number <= 0 || number == done_) return wait;
    current_ = number;
    krl.setToInt(3, number);
    const std::int32_t strategy = krl.frmInt(2);
    if (krl.frmInt(1) == 2) {
      if (krl.state() == FriState::Command) krl.friStop();
      finish(krl, 1);
    } else if (krl.frmInt(1) == 1 && isStrategy(strategy)) {
      if (krl.state() == FriState::Command && krl.krlStrategy() == strategy) {
        finish(krl, 1);
      } else {
        if (krl.state() == FriState::Command) krl.friStop();
        krl.setKrlStrategy(strategy);
        sequence_.begin();
        starting_ = true;
      }
    } else {
      finish(krl, -1);
    }
    return wait;
  }

 private:
  void finish(KrlInterface& krl, std::int32_t result) {
    starting_ = false;
    done_ = current_;
    krl.setToInt(1, done_);
    krl.setToInt(2, result);
    krl.setToInt(3, 0);
  }
  std::int32_t done_ = 0, current_ = 0;
};

/// CentroEPiaggio ros_control.src: levels in INT[2], strategy in INT[1], waits for #PERFECT.
class CentroEpiaggio : public BasicProgram {
 protected:
  void begin(KrlInterface& krl) override { krl.setToInt(2, 10); }

  double run(KrlInterface& krl) override {
    double wait = krl.parameters().krl_poll;
    const bool wanted = krl.frmInt(2) == 1;
    if (!wanted) armed_ = true;
    if (starting_) {
      const auto outcome =
          wanted ? sequence_.poll(krl, Quality::Perfect, wait) : StartSequence::Outcome::NotEntered;
      if (outcome == StartSequence::Outcome::Working) return wait;
      starting_ = false;
      if (outcome == StartSequence::Outcome::Started) krl.setToInt(2, shown_ = 1);
      return wait;
    }
    if (shown_ == 1 && (!wanted || krl.state() != FriState::Command)) {
      if (krl.state() == FriState::Command) krl.friStop();
      krl.setToInt(2, shown_ = 0);
    } else if (shown_ != 1 && wanted && armed_) {
      if (isStrategy(krl.frmInt(1))) krl.setKrlStrategy(krl.frmInt(1));
      sequence_.begin();
      starting_ = true;
      armed_ = false;  // after a fall-back the script needs a stop before the next start
      wait = krl.parameters().krl_message_wait;
    }
    return wait;
  }

 private:
  int shown_ = 10;
  bool armed_ = false;
};

/// Stanford FRIControl.src: levels in INT[16], does not wait for a quality, starts again while the
/// PC requests 10.
class Stanford : public BasicProgram {
 protected:
  void begin(KrlInterface& krl) override {
    krl.setToInt(15, kExitCode);
    krl.setToInt(16, 10);
  }

  double run(KrlInterface& krl) override {
    double wait = krl.parameters().krl_poll;
    if (closed_) return wait;
    const std::int32_t request = krl.frmInt(16);
    if (request == kExitCode) {
      krl.friStop();
      krl.friClose();
      krl.setToInt(16, 30);
      closed_ = true;
    } else if (starting_) {
      const auto outcome = request == 10 ? sequence_.poll(krl, Quality::Unacceptable, wait)
                                         : StartSequence::Outcome::NotEntered;
      if (outcome == StartSequence::Outcome::Working) return wait;
      starting_ = false;
      krl.setToInt(16, outcome == StartSequence::Outcome::Started ? 20 : 10);
      if (outcome != StartSequence::Outcome::Started) wait = krl.parameters().krl_message_wait;
    } else if (request == 10 && krl.state() == FriState::Monitor) {
      krl.setToInt(16, 10);
      if (isStrategy(krl.frmInt(15))) krl.setKrlStrategy(krl.frmInt(15));
      sequence_.begin();
      starting_ = true;
    } else if (request == 20 && krl.state() == FriState::Command) {
      krl.friStop();
      krl.setToInt(16, 10);
    } else if (krl.state() == FriState::Monitor) {
      krl.setToInt(16, 10);
    }
    return wait;
  }

 private:
  static constexpr std::int32_t kExitCode = 30;
  bool closed_ = false;
};

/// RCPRG / TUM fri_start.src: a flag in BOOL[1] with a code in INT[1]; always joint impedance;
/// needs a free arm.
class RcprgTum : public BasicProgram {
 protected:
  void begin(KrlInterface& krl) override { krl.setKrlStrategy(30); }

  double run(KrlInterface& krl) override {
    double wait = krl.parameters().krl_poll;
    if (starting_) {
      if (sequence_.poll(krl, Quality::Ok, wait) != StartSequence::Outcome::Working) finish(krl);
      return wait;
    }
    if (!krl.frmBool(1)) {
      handled_ = false;
      return wait;
    }
    if (handled_) return wait;
    krl.setToBool(1, true);
    switch (krl.frmInt(1)) {
      case 1:
        if (krl.state() == FriState::Command) {
          finish(krl);
        } else {
          sequence_.begin();
          starting_ = true;
        }
        break;
      case 2:
        krl.friStop();
        finish(krl);
        break;
      case 3:
        krl.friClose();
        krl.friOpen(krl.frmInt(2) * 1e-3);
        finish(krl);
        break;
      case 10:
        krl.nudge();
        finish(krl);
        wait = krl.parameters().krl_message_wait;
        break;
      default:
        krl.show("fri_start: unknown request " + std::to_string(krl.frmInt(1)));
        finish(krl);
    }
    return wait;
  }

 private:
  void finish(KrlInterface& krl) {
    starting_ = false;
    handled_ = true;
    krl.setToBool(1, false);
  }
  bool handled_ = false;
};

/// rtt_lwr (Orocos): codes in INT[1], shows the FRI state, the tool and the base frame.
class RttLwr : public BasicProgram {
 protected:
  double run(KrlInterface& krl) override {
    double wait = krl.parameters().krl_poll;
    if (ended_) return wait;
    const std::int32_t request = krl.frmInt(1);
    krl.setToInt(1, static_cast<std::int32_t>(krl.state()));
    krl.setToInt(3, krl.frmInt(3));
    for (int i = 1; i <= 6; ++i) krl.setToReal(i, 0.0F);  // the base frame is the robot's root
    if (request != 1) armed_ = true;
    if (starting_) {
      const auto outcome = request == 1 ? sequence_.poll(krl, Quality::Ok, wait)
                                        : StartSequence::Outcome::NotEntered;
      if (outcome != StartSequence::Outcome::Working) starting_ = false;
    } else if (request == 1 && armed_ && krl.state() == FriState::Monitor) {
      if (isStrategy(krl.frmInt(2))) krl.setKrlStrategy(krl.frmInt(2));
      sequence_.begin();
      starting_ = true;
      armed_ = false;
    } else if (request == 2 && krl.state() == FriState::Command) {
      krl.friStop();
    } else if (request == 3) {
      krl.friStop();
      krl.friClose();
      ended_ = true;
    }
    return wait;
  }

 private:
  bool armed_ = false, ended_ = false;
};

/// OpenKC, by its public clients and emulators: BOOL[1] with a command in INT[16]. TO_INT[15]
/// echoes the command, TO_INT[14] counts, TO_INT[16] is the result. TO_BOOL[1] signals it until the
/// PC clears BOOL[1]. Impedances: stiffness in INT, damping in REA.
class OpenKc : public BasicProgram {
 protected:
  double run(KrlInterface& krl) override {
    double wait = krl.parameters().krl_poll;
    if (ended_) return wait;
    if (starting_) {
      const auto outcome = sequence_.poll(krl, Quality::Unacceptable, wait);
      if (outcome == StartSequence::Outcome::Working) return wait;
      starting_ = false;
      if (outcome == StartSequence::Outcome::Started) acknowledge(krl, kStart, 100);
      return wait;
    }
    if (!krl.frmBool(1)) {
      krl.setToBool(1, false);
      served_ = false;
    } else if (!served_) {
      served_ = true;
      serve(krl, krl.frmInt(16));
    }
    return wait;
  }

 private:
  static constexpr int kStart = 1;

  void acknowledge(KrlInterface& krl, int command, int result) {
    krl.setToInt(15, command);
    krl.setToInt(14, ++count_);
    krl.setToInt(16, result);
    krl.setToBool(1, true);
  }

  void switchTo(KrlInterface& krl, int command, int strategy, int result) {
    if (krl.setKrlStrategy(strategy)) acknowledge(krl, command, result);
  }

  void setJointImpedance(KrlInterface& krl) {
    Vector7 stiffness, damping;
    for (int i = 0; i < 7; ++i) {
      stiffness[i] = krl.frmInt(9 + i);
      damping[i] = static_cast<double>(krl.frmReal(10 + i));
    }
    krl.setJointImpedance(stiffness, damping);
  }

  void setCartesianImpedance(KrlInterface& krl) {
    Vector6 stiffness, damping;
    for (int i = 0; i < 6; ++i) {
      const int axis = i < 3 ? i : 8 - i;  // KRL's angles A B C rotate about z y x
      stiffness[axis] = krl.frmInt(10 + i);
      damping[axis] = static_cast<double>(krl.frmReal(11 + i));
    }
    krl.setCartesianImpedance(stiffness, damping);
  }

  void serve(KrlInterface& krl, int command) {
    switch (command) {
      case kStart:
        if (krl.state() == FriState::Command) return acknowledge(krl, command, 100);
        sequence_.begin();
        starting_ = true;
        return;
      case 2:
        krl.friStop();
        return acknowledge(krl, command, 101);
      case 3:
        count_ = -1;
        return acknowledge(krl, command, 111);
      case 4:
        setCartesianImpedance(krl);
        return acknowledge(krl, command, 102);
      case 5:
        setJointImpedance(krl);
        return acknowledge(krl, command, 103);
      case 6:
        return switchTo(krl, command, 20, 104);
      case 7:
        return switchTo(krl, command, 30, 105);
      case 9:
        return switchTo(krl, command, 10, 107);
      case 30:  // without echo, unlike the others
        if (krl.setKrlStrategy(krl.frmInt(2))) krl.setToBool(1, true);
        return;
      case 98:
        krl.friClose();
        krl.friOpen(0.0);
        return;
      case 99:
        krl.friClose();
        ended_ = true;
        return;
      default:
        krl.show("openkc: command " + std::to_string(command) + " is not served by this stand-in");
    }
  }

  int count_ = 0;
  bool served_ = false, ended_ = false;
};

/// KUKA's sample application: the PC sets INT[1] to 10 when it is ready. There is one run; INT[1] =
/// -1 ends it.
class KukaSample : public BasicProgram {
 protected:
  double run(KrlInterface& krl) override {
    double wait = krl.parameters().krl_poll;
    krl.setToReal(2, pulse_ += 1.0F);
    if (starting_) {
      const auto outcome = sequence_.poll(krl, Quality::Ok, wait);
      if (outcome == StartSequence::Outcome::Working) return wait;
      starting_ = false;
      started_ = outcome == StartSequence::Outcome::Started;
    } else if (started_ && krl.state() != FriState::Command) {
      krl.setToInt(1, -1);
    } else if (!started_ && krl.frmInt(1) == 10) {
      sequence_.begin();
      starting_ = true;
    }
    return wait;
  }

 private:
  float pulse_ = 0.0F;
  bool started_ = false;
};

}  // namespace

std::unique_ptr<KrlProgram> makeKrlProgram(KrlConvention convention) {
  switch (convention) {
    case KrlConvention::Coglab:
      return std::make_unique<Coglab>();
    case KrlConvention::CentroEpiaggio:
      return std::make_unique<CentroEpiaggio>();
    case KrlConvention::Stanford:
      return std::make_unique<Stanford>();
    case KrlConvention::RcprgTum:
      return std::make_unique<RcprgTum>();
    case KrlConvention::RttLwr:
      return std::make_unique<RttLwr>();
    case KrlConvention::OpenKc:
      return std::make_unique<OpenKc>();
    case KrlConvention::KukaSample:
      return std::make_unique<KukaSample>();
  }
  throw std::invalid_argument("no such KRL convention");
}

KrlConvention krlConventionOf(const std::string& name) {
  std::string known;
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (name == kNames[i]) return static_cast<KrlConvention>(i);
    known += std::string(i == 0 ? "" : ", ") + kNames[i];
  }
  throw std::invalid_argument("unknown KRL convention '" + name + "'; known: " + known);
}

std::string nameOf(KrlConvention convention) {
  return kNames[static_cast<std::size_t>(convention)];
}

}  // namespace coglab_sim::krc
