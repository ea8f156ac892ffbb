#include "coglab_contact/moving_contact.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace coglab_contact {
namespace {

constexpr double kHold = 0.03;     // s, validity of one sample
constexpr double kStill = 0.02;    // rad/s; the arm moves if a joint is faster
constexpr double kSlow = 0.15;     // rad/s of the fastest joint
constexpr double kGentle = 1.0;    // rad/s^2
constexpr double kSettled = 0.25;  // s of standstill before the residual is that of a free arm
constexpr double kLead = 0.03;     // s ahead: about the delay of the observer
constexpr double kGrowth = 0.02;   // s over which the growth of the force is measured
constexpr const char* kSource = "momentum";

}  // namespace

MovingContact::MovingContact(std::shared_ptr<ArmModel> model, JacobianAt jacobian, double period)
    : observer_(std::move(model), 40.0, period), jacobian_(std::move(jacobian)) {}

void MovingContact::use(const MotionThresholds& thresholds) {
  thresholds_ = thresholds;
  observer_.lag = thresholds.lag;
}

void MovingContact::setPayload(double mass, const Vector3& centre) {
  observer_.setPayload(mass, centre);
  load_ = mass;
  forget();
}

void MovingContact::forget() {
  changes_.reset();
  growing_.clear();
  change_.reset();
  last_change_.reset();
  still_since_.reset();
  rest_.reset();
  free_.reset();
  free_weight_.reset();
}

void MovingContact::feed(double stamp, const Joints& position, const Joints& torque,
                         std::optional<double> made) {
  residual_ = observer_.feed(stamp, position, torque, made);
  if (!residual_) return;
  if (residual_->fresh) forget();
  followRest(*residual_);
  const double now = made.value_or(residual_->stamp);
  if (!growing_.empty() && now < growing_.back().stamp) growing_.clear();
  growing_.push({now, residual_->torque});
  while (growing_.front().stamp < now - kGrowth - 1e-9) growing_.pop();
  if (change_) last_change_ = change_;
  change_ = changes_.feed(*residual_, load_, jacobian_(position));
}

void MovingContact::followRest(const Residual& residual) {
  if (residual.velocity.cwiseAbs().maxCoeff() > kStill) {
    if (rest_) {
      free_ = rest_;
      free_weight_ = weight(*rest_, rest_position_);
    }
    still_since_.reset();
    rest_.reset();
  } else if (!still_since_) {
    still_since_ = residual.stamp;
  } else if (residual.stamp - *still_since_ >= kSettled) {
    const Joints rest = rest_.value_or(residual.torque);
    const double share = std::min(1.0, (residual.stamp - rest_stamp_) / kRemembered);
    rest_ = rest + share * (residual.torque - rest);
    rest_position_ = residual.position;
    rest_stamp_ = residual.stamp;
  }
}

std::optional<Evidence> MovingContact::evidence() const {
  if (!residual_ || !change_) return std::nullopt;
  // Two samples in a row have to be over the limit.
  const PalmForce now = thresholds_.force(*change_);
  const double sure =
      last_change_ ? std::min(now.size, thresholds_.force(*last_change_).size) : 0.0;
  char text[96];
  std::snprintf(text, sizeof text, "%.1f N on the hand, %.0f deviations of the moving arm's",
                now.force.norm(), now.size);
  return Evidence{kSource, change_->stamp, change_->stamp + kHold, sure / thresholds_.limit, text};
}

std::optional<Evidence> MovingContact::steady() const {
  const std::optional<Offset> there = offset();
  if (!there || load_ > 0.0) return std::nullopt;
  const PalmForce found = thresholds_.steadyForce(*there, change_->features);
  char text[96];
  std::snprintf(text, sizeof text,
                "%.1f N on the hand since the arm stood still: it was there already",
                found.force.norm());
  return Evidence{kSource, change_->stamp, change_->stamp + kHold,
                  found.size / thresholds_.steady_limit, text};
}

bool MovingContact::slow() const {
  return residual_ && residual_->velocity.cwiseAbs().maxCoeff() <= kSlow &&
         residual_->acceleration.cwiseAbs().maxCoeff() < kGentle;
}

std::optional<Offset> MovingContact::offset() const {
  if (!change_ || !free_) return std::nullopt;
  return Offset{changes_.past() - *free_, change_->jacobian};
}

std::optional<Offset> MovingContact::offsetOfMotion() const {
  if (!change_ || !free_ || !rest_) return std::nullopt;
  return Offset{*rest_ - *free_, change_->jacobian};
}

double MovingContact::weight(const Joints& residual, const Joints& position) const {
  return -forceOnPalm(jacobian_(position), residual).z();
}

std::optional<Vector3> MovingContact::forceSince(const Joints& before) const {
  if (growing_.empty() || !residual_) return std::nullopt;
  const Moment &first = growing_.front(), &last = growing_.back();
  Joints growth = Joints::Zero();
  if (last.stamp > first.stamp) growth = (last.torque - first.torque) / (last.stamp - first.stamp);
  return forceOnPalm(jacobian_(residual_->position), last.torque + kLead * growth - before);
}

}  // namespace coglab_contact
