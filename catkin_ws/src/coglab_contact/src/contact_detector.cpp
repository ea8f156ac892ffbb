#include "coglab_contact/contact_detector.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <utility>

namespace coglab_contact {
namespace {

constexpr double kJolt = 0.02;          // rad, largest motion when a person pushes a resting arm
constexpr double kGravity = 9.81;       // m/s^2
constexpr double kMadToSigma = 1.4826;  // standard deviation over median absolute deviation
constexpr double kLargest = 1e4;        // Nm, rad, rad/s: no arm has more
constexpr double kLongestStep = 1.0;    // s between two consecutive samples
constexpr std::size_t kRestSamples = 400;

template <typename... Values>
std::string text(const char* format, Values... values) {
  char line[160];
  std::snprintf(line, sizeof line, format, values...);
  return line;
}

std::string listOf(const std::vector<int>& numbers, int more) {
  std::string all = "[";
  for (int number : numbers) all += (all.size() > 1 ? ", " : "") + std::to_string(number + more);
  return all + "]";
}

/// Probability that a signal is over its threshold if it was measured `deviations` standard
/// deviations above it, for normal noise.
double confidence(double deviations) { return 0.5 * (1.0 + std::erf(deviations / std::sqrt(2.0))); }

double medianOf(double* begin, double* end) {
  double* middle = begin + (end - begin) / 2;
  std::nth_element(begin, middle, end);
  if ((end - begin) % 2 == 1) return *middle;
  return 0.5 * (*std::max_element(begin, middle) + *middle);
}

bool possible(const Joints& values) { return (values.array().abs() <= kLargest).all(); }

}  // namespace

void RestTorque::move(double gap, const Joints& velocity) {
  if (!travelled_) {
    left_ = here_;
    travelled_ = Joints::Zero();
  }
  *travelled_ += gap * velocity;
  if (left_ && travels()) before_motion_ = left_;
}

bool RestTorque::travels() const { return travelled_ && travelled_->cwiseAbs().maxCoeff() > kJolt; }

void RestTorque::stand() {
  here_.reset();
  travelled_.reset();
}

void RestTorque::learn(const Joints& torque, double gap) {
  const double share = std::min(1.0, gap / kRemembered);
  here_ = here_ ? Joints(*here_ + share * (torque - *here_)) : torque;
}

ContactDetector::ContactDetector(const DetectorSettings& settings, JacobianAt jacobian)
    : settings_(settings), jacobian_(std::move(jacobian)) {}

void ContactDetector::arm(const Request& request) {
  const std::string& mode = request.mode;
  if (mode != "contact" && mode != "load" && mode != "release")
    throw std::invalid_argument("mode is contact, load, release or off, got '" + mode + "'");
  if (!(request.timeout > 0.0))
    throw std::invalid_argument(
        text("timeout must be a positive time in s, got %g", request.timeout));
  if (mode != "contact" && !(request.mass > 0.0))
    throw std::invalid_argument(mode +
                                text(" needs the mass of the object in kg, got %g", request.mass));
  if (mode == "load" && !unloaded_)
    throw std::invalid_argument(
        "load is counted from the torque before the contact: arm for contact first");
  for (int joint : request.joints)
    if (joint < 1 || joint > 7)
      throw std::invalid_argument("joints are numbered 1..7, got " + listOf(request.joints, 0));
  Armed armed;
  armed.mode = mode;
  armed.until = request.now + request.timeout;
  armed.k = request.k > 0.0 ? request.k : settings_.k;
  for (int joint : request.joints)
    if (std::count(armed.joints.begin(), armed.joints.end(), joint - 1) == 0)
      armed.joints.push_back(joint - 1);
  armed.mass = request.mass;
  armed.load_share = request.load_share > 0.0 ? request.load_share : settings_.load_share;
  armed.carries = request.carries;
  armed_ = std::move(armed);
}

void ContactDetector::tune(const DetectorSettings& settings) {
  const DetectorSettings before = settings_;
  settings_ = settings;
  settings_.cutoff = before.cutoff;
  settings_.window = before.window;
  settings_.learn_samples = before.learn_samples;
}

std::string ContactDetector::learn() {
  if (armed_)
    throw std::invalid_argument("armed for " + armed_->mode +
                                "; the noise is learnt between actions, send mode off first");
  if (!still())
    throw std::invalid_argument("the arm moves, or no torques come; the noise is learnt at rest");
  rest_differences_.clear();
  return "learning from the next " + std::to_string(settings_.learn_samples) +
         " samples; leave the arm alone";
}

const char* ContactDetector::state() const {
  if (!armed_) return "off";
  return armed_->baseline ? "watching" : "waiting";
}

bool ContactDetector::still() const {
  return still_since_ && last_stamp_ && *last_stamp_ - *still_since_ >= settings_.settle;
}

Joints ContactDetector::takeLargest() {
  const Joints largest = largest_;
  largest_.setZero();
  return largest;
}

Joints ContactDetector::sigma() const {
  const std::size_t count = rest_differences_.size();
  if (count < 2) return Joints::Constant(settings_.floor);
  std::array<double, kRestSamples> values;
  Joints deviation;
  for (int joint = 0; joint < 7; ++joint) {
    for (std::size_t i = 0; i < count; ++i) values[i] = rest_differences_[i][joint];
    const double median = medianOf(values.data(), values.data() + count);
    for (std::size_t i = 0; i < count; ++i)
      values[i] = std::abs(rest_differences_[i][joint] - median);
    deviation[joint] = kMadToSigma * medianOf(values.data(), values.data() + count);
  }
  return deviation.cwiseMax(settings_.floor);
}

std::optional<ContactEvent> ContactDetector::feed(double stamp, const Joints& torque,
                                                  const Joints& position, const Joints& velocity) {
  if (!possible(torque) || !possible(position) || !possible(velocity) || !inTime(stamp))
    return std::nullopt;
  followMotion(stamp, velocity);
  const std::optional<Joints> difference = filter(stamp, torque);
  if (difference)
    for (int joint = 0; joint < 7; ++joint)
      if (std::abs((*difference)[joint]) > std::abs(largest_[joint]))
        largest_[joint] = (*difference)[joint];
  if (armed_ && stamp > armed_->until) armed_.reset();
  if (!still() || !difference) {
    if (armed_) {
      // The arm does not rest any more: take a new baseline later.
      Armed& a = *armed_;
      if (rest_.travels())
        a.before.reset();
      else if (!a.before)
        a.before = a.baseline;
      a.baseline.reset();
      a.over = 0;
    }
    return std::nullopt;
  }
  if (!armed_) {
    keep(*difference);
    return std::nullopt;
  }
  return watch(stamp, *difference, position);
}

/// Whether a sample follows the previous one. A single odd sample is ignored. Two consecutive ones
/// mean that the clock was set, or that samples were missing for long. Then an arming keeps its
/// remaining time, and the arm must be seen still again.
bool ContactDetector::inTime(double stamp) {
  const std::optional<double> last = last_stamp_, odd = odd_stamp_;
  const auto follows = [stamp](double before) {
    return stamp - before > 0.0 && stamp - before <= kLongestStep;
  };
  odd_stamp_.reset();
  if (!last || follows(*last)) return true;
  if (!odd || !follows(*odd)) {
    odd_stamp_ = stamp;
    return false;
  }
  if (armed_) {
    armed_->until += stamp - *last;
    armed_->gone_since.reset();
  }
  last_stamp_.reset();
  still_since_.reset();
  return true;
}

void ContactDetector::followMotion(double stamp, const Joints& velocity) {
  if (velocity.cwiseAbs().maxCoeff() > settings_.still_speed) {
    rest_.move(last_stamp_ ? stamp - *last_stamp_ : 0.0, velocity);
    still_since_.reset();
  } else if (!still_since_) {
    still_since_ = stamp;
    history_.clear();
    filtered_.reset();
    rest_.stand();
  }
}

/// Low-passes and stores a sample. Returns the difference over the window; none until it is full.
std::optional<Joints> ContactDetector::filter(double stamp, const Joints& torque) {
  const double dt = last_stamp_ ? stamp - *last_stamp_ : 0.005;
  last_stamp_ = stamp;
  gap_ = dt;
  if (!filtered_ || dt > 0.1) {
    filtered_ = torque;
    history_.clear();
  }
  const double blend = 1.0 - std::exp(-2.0 * M_PI * settings_.cutoff * dt);
  *filtered_ += blend * (torque - *filtered_);
  history_.push({stamp, *filtered_});
  const double oldest = stamp - settings_.window + 1e-9;
  while (history_.size() > 1 && history_[1].stamp <= oldest) history_.pop();
  if (history_.front().stamp > oldest) return std::nullopt;
  return Joints(*filtered_ - history_.front().torque);
}

void ContactDetector::keep(const Joints& difference) {
  if (rest_differences_.size() == kRestSamples) rest_differences_.pop();
  rest_differences_.push(difference);
  rest_.learn(*filtered_, gap_);
}

/// Joints whose torque is most sensitive to forces across the line from person to robot: the lever
/// of a joint is the norm of its column without the part along that line.
std::vector<int> ContactDetector::sensitiveJoints(const PalmJacobian& jacobian) const {
  const Vector3 d = settings_.user_direction.normalized();
  const PalmJacobian across = jacobian - d * (d.transpose() * jacobian);
  const Joints lever = across.colwise().norm().transpose();
  std::vector<int> joints;
  for (int joint = 0; joint < 7; ++joint)
    if (lever[joint] >= settings_.sensitivity_share * lever.maxCoeff()) joints.push_back(joint);
  return joints;
}

std::optional<ContactEvent> ContactDetector::watch(double stamp, const Joints& difference,
                                                   const Joints& position) {
  Armed& a = *armed_;
  if (restSamples() < static_cast<std::size_t>(std::max(0, settings_.learn_samples))) {
    keep(difference);
    return std::nullopt;
  }
  if (!a.baseline) {
    a.baseline = *filtered_;
    a.watched = a.joints.empty() ? sensitiveJoints(jacobian_(position)) : a.joints;
    a.threshold = a.k * sigma();
    if (a.mode == "contact") unloaded_ = a.baseline;
    return checkOffset();
  }
  if (a.mode != "contact") return watchWeight(stamp, position);
  margin_ = 0.0;
  for (int joint : a.watched)
    margin_ = std::max(margin_, std::abs(difference[joint]) / a.threshold[joint]);
  a.over = margin_ > 1.0 ? a.over + 1 : 0;
  if (a.over < settings_.confirm) return std::nullopt;
  // In standard deviations, the threshold is k and the signal is margin times k.
  ContactEvent event{true,
                     "joint_torque",
                     margin_,
                     "torque of joints " + listOf(a.watched, 1) +
                         text(" changed by %.1f x its threshold within %.0f ms", margin_,
                              settings_.window * 1000.0),
                     confidence((margin_ - 1.0) * a.k),
                     static_cast<int>(Found::contact)};
  armed_.reset();
  return event;
}

/// Checks the offset once at each rest. An early touch leaves an offset against the last rest
/// before the motion. A touch that jolted the arm leaves one against the torque before the jolt.
std::optional<ContactEvent> ContactDetector::checkOffset() {
  Armed& a = *armed_;
  const std::optional<Joints> before_motion = a.carries ? std::nullopt : rest_.beforeMotion();
  const std::optional<Joints> reference = a.before ? a.before : before_motion;
  if (a.mode != "contact" || !reference || a.watched.empty()) return std::nullopt;
  double offset = 0.0;
  int largest = a.watched.front();
  for (int joint : a.watched) {
    const double here = std::abs((*a.baseline)[joint] - (*reference)[joint]);
    if (here > offset) {
      offset = here;
      largest = joint;
    }
  }
  const double ratio = offset / settings_.offset_threshold;
  if (!(ratio > 1.0)) return std::nullopt;
  unloaded_ = reference;
  const bool early = !a.before;
  ContactEvent event{true,
                     "torque_offset",
                     ratio,
                     text("torque offset %.2f Nm ", offset) +
                         (early ? "on arming: the object was there already" : "after a jolt"),
                     confidence((offset - settings_.offset_threshold) / sigma()[largest]),
                     static_cast<int>(early ? Found::early : Found::contact)};
  armed_.reset();
  return event;
}

/// Checks whether the weight has arrived (load) or gone (release).
std::optional<ContactEvent> ContactDetector::watchWeight(double stamp, const Joints& position) {
  Armed& a = *armed_;
  const bool loading = a.mode == "load";
  const Joints change = *filtered_ - (loading ? *unloaded_ : *a.baseline);
  const Joints lever = jacobian_(position).row(2).transpose();
  // Least squares with one unknown: the vertical force (N, positive upward) that explains the
  // change of torque.
  double along = 0.0, square = 0.0;
  for (int joint : a.watched) {
    along += lever[joint] * change[joint];
    square += lever[joint] * lever[joint];
  }
  const double force = (loading ? -1.0 : 1.0) * along / square;
  const double needed = a.load_share * a.mass * kGravity;
  margin_ = force / needed;
  if (!(margin_ >= 1.0)) {  // also if no joint is watched
    a.gone_since.reset();
    return std::nullopt;
  }
  if (!a.gone_since) a.gone_since = stamp;
  const double confirm = loading ? settings_.load_confirm : settings_.release_confirm;
  if (stamp - *a.gone_since < confirm) return std::nullopt;
  const Joints noise = sigma();
  double variance = 0.0;
  for (int joint : a.watched) variance += std::pow(lever[joint] * noise[joint], 2);
  const double deviation = std::sqrt(variance) / square;
  ContactEvent event{loading,
                     "joint_torque",
                     margin_,
                     text("%.1f N %s (needed %.1f N)", force,
                          loading ? "carried now" : "of the load are gone", needed),
                     confidence((force - needed) / deviation),
                     static_cast<int>(loading ? Found::carried : Found::released)};
  armed_.reset();
  return event;
}

}  // namespace coglab_contact
