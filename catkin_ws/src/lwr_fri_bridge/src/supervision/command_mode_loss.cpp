#include "lwr_fri_bridge/supervision/command_mode_loss.hpp"

#include <algorithm>
#include <cmath>

namespace lwr_fri_bridge {
namespace {

constexpr double kFading = 1.0;       // s, time constant of recorded lateness and losses
constexpr double kLateCycles = 3.0;   // cycles; lateness that may end command mode
constexpr double kLostPackets = 2.5;  // packets: three lost ones, of which the first have faded
constexpr double kRestSpeed = 0.02;   // rad/s; far above the noise of the velocity filter
constexpr double kRestTime = 0.5;     // s at rest before the loss
constexpr double kCalmTime = 0.1;     // s at rest before a restart
constexpr double kMoved = 0.002;      // rad, largest motion since the loss
constexpr std::int64_t kOften_ns = 60'000'000'000;  // at most three restarts in this time

}  // namespace

std::string describe(const CommandModeLoss& loss) {
  const std::string lost = "command mode was lost because ";
  const std::string time = std::to_string(std::lround(1e3 * loss.seconds)) + " ms";
  switch (loss.cause) {
    case LossCause::None:
      break;
    case LossCause::ComputerLate:
      return lost + "this computer was " + time +
             " late with its answers (load, or no real-time priority)";
    case LossCause::ControllerStalled:
      return lost + "the robot controller, which runs on this computer, was not run for " + time +
             " (load)";
    case LossCause::ControllerSilent:
      return lost + "the robot controller was silent for " + time +
             " (cable, or its program ended)";
    case LossCause::PacketsLost:
      return "command mode was lost after packets had been lost on the way (cable, switch)";
    case LossCause::PowerLost:
      return "the drives lost their power (enabling switch, emergency stop)";
    case LossCause::BeganAnew:
      return "the robot controller restarted";
    case LossCause::LeftByController:
      return "the robot controller left command mode by itself; read its messages on the pendant";
  }
  return {};
}

void CommandModeWatch::tick(double seconds, std::uint32_t lost, double measured_speed,
                            double commanded_speed) {
  const double kept = std::exp(-seconds / kFading);
  late_ *= kept;
  lost_ = kept * lost_ + lost;
  const bool rests = commanded_speed < kRestSpeed && measured_speed < kRestSpeed;
  rest_ = rests ? rest_ + seconds : 0.0;
}

CommandModeLoss CommandModeWatch::judge(const Facts& facts) const {
  CommandModeLoss loss;
  loss.at_rest = rest_ >= kRestTime;
  loss.timestamp = facts.timestamp;
  loss.position = facts.position;
  loss.seconds = late_;
  const bool late = late_ > kLateCycles * facts.cycle_time;
  if (!facts.connected) {
    loss.seconds = facts.silence;
    // A thread that was late for most of the silence cannot know whether the controller was silent.
    loss.cause = late && late_ > 0.5 * facts.silence ? LossCause::ComputerLate
                 : controller_here_                  ? LossCause::ControllerStalled
                                                     : LossCause::ControllerSilent;
  } else if (facts.fresh_session) {
    loss.cause = LossCause::BeganAnew;
  } else if (facts.command_mode) {
    loss.cause = LossCause::PowerLost;
  } else {
    loss.cause = late                    ? LossCause::ComputerLate
                 : lost_ >= kLostPackets ? LossCause::PacketsLost
                                         : LossCause::LeftByController;
  }
  return loss;
}

bool QuietRestart::mayRestart(const View& view) const {
  return view.stopped && !view.held && view.may_command && view.loss.byComputer() &&
         view.loss.at_rest && !(view.loss == judged_) &&
         view.timestamp > view.loss.timestamp &&  // the same controller, not restarted
         (view.position - view.loss.position).cwiseAbs().maxCoeff() < kMoved &&
         view.velocity.cwiseAbs().maxCoeff() < kRestSpeed;
}

bool QuietRestart::due(const View& view, std::int64_t now_ns) {
  if (!mayRestart(view)) {
    calm_since_ns_ = 0;
    return false;
  }
  if (calm_since_ns_ == 0) calm_since_ns_ = now_ns;
  if (1e-9 * static_cast<double>(now_ns - calm_since_ns_) < kCalmTime) return false;
  if (restarts_ns_[0] != 0 && now_ns - restarts_ns_[0] < kOften_ns) return false;
  judged_ = view.loss;
  calm_since_ns_ = 0;
  std::rotate(restarts_ns_.begin(), restarts_ns_.begin() + 1, restarts_ns_.end());
  restarts_ns_.back() = now_ns;
  return true;
}

}  // namespace lwr_fri_bridge
