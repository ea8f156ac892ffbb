/// @file
/// Losses of datagrams in both directions, and the limits that a controller's set-points must keep
/// under any loss. Tests run a sample of it, bench/loss_campaign.cpp all of it.
#pragma once

#include <algorithm>
#include <cmath>
#include <deque>
#include <random>

#include "small_controller.hpp"

namespace lwr_fri_bridge::test {

/// Which datagrams get lost: a share of the cycles, each loses its measurement or its answer with
/// equal chance; one cycle at a time or bursts of 1..5. As much as coglab_sim's controller rides
/// through: 5 cycles in a row, 20 of any 100.
class LossPattern {
 public:
  enum class Lost { Nothing, Measurement, Answer };

  LossPattern(double share, bool bursts, unsigned seed)
      : mean_(bursts ? 3.0 : 1.0), bursts_(bursts), random_(seed) {
    begin_ = share / (mean_ * (1.0 - share));
  }

  Lost next() {
    std::uniform_real_distribution<double> part(0.0, 1.0);
    if (left_ == 0 && !last_ && part(random_) < begin_)
      left_ = bursts_ ? 1 + static_cast<int>(random_() % 5) : 1;
    if (lost_ >= 20) left_ = 0;
    last_ = left_ > 0;
    if (last_) --left_;
    window_.push_back(last_);
    lost_ += last_ ? 1 : 0;
    if (window_.size() == 100) {
      lost_ -= window_.front() ? 1 : 0;
      window_.pop_front();
    }
    if (!last_) return Lost::Nothing;
    return part(random_) < 0.5 ? Lost::Measurement : Lost::Answer;
  }

 private:
  double mean_, begin_ = 0.0;
  bool bursts_, last_ = false;
  std::mt19937 random_;
  int left_ = 0, lost_ = 0;
  std::deque<bool> window_;  // the last 99 cycles
};

struct LossCase {
  double period;  ///< s
  double share;   ///< of the cycles that lose a datagram
  bool bursts;
  bool extrapolates;  ///< the kind of controller
  unsigned seed;
  /// The connection has lost nothing for 1200 cycles when the motion begins, and loses from a
  /// random moment of it on; else it loses from its first cycle on.
  bool clean_first = false;
};

/// Largest violations by a controller's set-points in a run, over all joints.
struct SetPointExtremes {
  double beyond = -1e9;       ///< rad beyond the bound (limit less margin), negative: inside
  double speed = 0.0;         ///< rad/s beyond the speed limit
  double acceleration = 0.0;  ///< rad/s^2 beyond the limit, by differences of what was answered
};

/// A stop of one joint.
struct Stop {
  double angle = 0.0;            ///< rad from the hold to rest
  bool from_full_speed = false;  ///< at the speed limit when it was held; else the angle is no stop
};

/// One run: the connection is up for a while, then every joint is sent to an end of its range at
/// full speed, sometimes turned round on the way, in a third of the runs with a hold that is reset
/// once the arm stands.
class LossRun {
 public:
  explicit LossRun(const LossCase& c, bool stays_away = false)
      : case_(c),
        bridge_(defaultConfig()),
        robot_(c.period),
        loss_(c.share, c.bursts, c.seed),
        random_(c.seed + 77),
        clean_(c.clean_first ? 1 : 0) {
    robot_.extrapolates = c.extrapolates;
    const JointLimits& limits = bridge_.config().limits;
    for (int i = 0; i < 7; ++i) {
      direction_[i] = random_() % 2 == 0 ? 1.0 : -1.0;
      const double room = stays_away ? limits.upper_position[i] + 1.0 : part(0.3, 1.5);
      start_[i] = direction_[i] * (limits.upper_position[i] - room);
    }
    robot_.moveOwn(start_);
    robot_.setMeasured(start_);
    for (int i = 0; i < 3; ++i) robot_.cycle(bridge_);
    started_ = runEvent(bridge_, robot_, "start").success();
    last_ = robot_.setPoint();
    last_velocity_.setZero();
    const unsigned idle = case_.clean_first ? 1200 : random_() % 1500;
    for (unsigned i = idle; i > 0; --i) cycle(Vector7::Zero());
    if (case_.clean_first) clean_ = static_cast<int>(part(0.0, 1.8) / case_.period);
  }

  SetPointExtremes approach() {
    const Vector7 towards = direction_.cwiseProduct(bridge_.config().limits.velocity);
    const int cycles = static_cast<int>(2.0 / case_.period);
    const int hold_at = random_() % 3 == 0 ? static_cast<int>(part(0.0, 1.0) * cycles) : -1;
    Vector7 wanted = towards;
    begun_ = true;
    for (int i = 0; i < cycles; ++i) {
      if (i == hold_at) bridge_.submit("hold");
      if (i == hold_at + static_cast<int>(0.6 / case_.period)) bridge_.submit("reset");
      if (i % std::max(1, static_cast<int>(0.25 / case_.period)) == 0)
        wanted = (random_() % 8 == 0 ? -1.0 : 1.0) * towards;
      cycle(wanted);
    }
    return extremes_;
  }

  /// The worst of the budget, from a cycle of the motion on: 20 lost cycles in groups of 5, one
  /// answer between them.
  SetPointExtremes approachLosing(int begin) {
    const Vector7 towards = direction_.cwiseProduct(bridge_.config().limits.velocity);
    for (int i = 0; i < static_cast<int>(1.8 / case_.period); ++i) {
      const int since = i - begin;
      const bool lost = since >= 0 && since < 23 && since % 6 != 5;
      cycle(towards, !lost            ? LossPattern::Lost::Nothing
                     : since % 2 == 0 ? LossPattern::Lost::Measurement
                                      : LossPattern::Lost::Answer);
    }
    return extremes_;
  }

  /// A hold of the fifth joint at full speed, far from its limits, on a controller that
  /// extrapolates. A controller that stands restarts after each loss and is not at full speed.
  Stop stop() {
    const double full = bridge_.config().limits.velocity[4];
    Vector7 wanted = Vector7::Zero();
    wanted[4] = direction_[4] * full;
    for (int i = 0; i < static_cast<int>(0.7 / case_.period); ++i) cycle(wanted);
    bridge_.submit("hold");
    const double from = robot_.setPoint()[4];
    const bool at_full = started_ && direction_[4] * last_velocity_[4] > 0.99 * full;
    for (int i = 0; i < static_cast<int>(1.5 / case_.period); ++i) cycle(wanted);
    return {std::abs(robot_.setPoint()[4] - from), at_full};
  }

  bool started() const { return started_; }
  bool commanding() const { return robot_.state == fri::FriState::Command; }
  Bridge& bridge() { return bridge_; }

 private:
  double part(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  void cycle(const Vector7& wanted) {
    cycle(wanted, clean_ > 0 ? LossPattern::Lost::Nothing : loss_.next());
    if (begun_ && clean_ > 0) --clean_;
  }

  void cycle(const Vector7& wanted, LossPattern::Lost lost) {
    drive(bridge_, robot_, wanted);
    const bool answered = lost == LossPattern::Lost::Nothing;
    robot_.cycle(bridge_, lost == LossPattern::Lost::Measurement,
                 lost == LossPattern::Lost::Answer);
    const JointLimits& limits = bridge_.config().limits;
    const double margin = bridge_.config().position_margin;
    const double noise = 6e-7 / case_.period;  // rad/s; float32 on the wire, twice
    const Vector7 q = robot_.setPoint(), v = (q - last_) / case_.period;
    for (int i = 0; i < 7; ++i) {
      extremes_.beyond = std::max({extremes_.beyond, q[i] - (limits.upper_position[i] - margin),
                                   limits.lower_position[i] + margin - q[i]});
      extremes_.speed = std::max(extremes_.speed, std::abs(v[i]) - limits.velocity[i] - noise);
      // Ignore a stop that the controller makes by itself.
      if (answered || robot_.extrapolates) {
        const double change = std::abs(v[i] - last_velocity_[i]) - 2.0 * noise;
        extremes_.acceleration =
            std::max(extremes_.acceleration, change / case_.period - limits.acceleration[i]);
      }
    }
    last_ = q;
    last_velocity_ = v;
  }

  LossCase case_;
  Bridge bridge_;
  SmallController robot_;
  LossPattern loss_;
  std::mt19937 random_;
  Vector7 direction_, start_, last_, last_velocity_;
  SetPointExtremes extremes_;
  bool started_ = false, begun_ = false;
  int clean_ = 0;  ///< cycles without loss that are still to come
};

}  // namespace lwr_fri_bridge::test
