#include "basic_program.hpp"

namespace coglab_sim::krc {

using lwr_fri_bridge::fri::FriState;
using lwr_fri_bridge::fri::Quality;

namespace {

/// OpenKC, as public clients and emulators of its program speak it: BOOL[1] with a command in
/// INT[16]; TO_INT[15] echoes it, TO_INT[14] counts, TO_INT[16] is the result, TO_BOOL[1] says so
/// until the PC has taken BOOL[1] back. Impedances: stiffness in INT, damping in REA.
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
      const int axis = i < 3 ? i : 8 - i;  // KRL's A B C turn about z y x
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

}  // namespace

std::unique_ptr<KrlProgram> makeOpenKc() { return std::make_unique<OpenKc>(); }

}  // namespace coglab_sim::krc
