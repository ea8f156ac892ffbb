#include "coglab_perception/reach_bank.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "coglab_perception/minimum_jerk.hpp"

namespace coglab_perception {
namespace {

constexpr double kNever = -std::numeric_limits<double>::infinity();  // arrival of a hand at rest
constexpr double kSpawnStep = 0.035;  // s between onsets, if observations are farther apart
constexpr double kUnlikely = 13.0;    // logarithm of the factor to the best hypothesis when dropped

/// Density (1/m^3) of a normal distribution with independent axes.
double density(const Vector3d& way, const Vector3d& deviation) {
  const Vector3d share = way.cwiseQuotient(deviation);
  return std::exp(-0.5 * share.squaredNorm()) / (std::pow(2.0 * M_PI, 1.5) * deviation.prod());
}

/// Logarithm of a sum of exponentials.
template <typename Range, typename Log>
double logSum(const Range& range, Log log) {
  double top = kNever, sum = 0.0;
  for (const auto& one : range) top = std::max(top, log(one));
  for (const auto& one : range) sum += std::exp(log(one) - top);
  return top + std::log(sum);
}

}  // namespace

bool ReachBank::Hypothesis::resting() const { return arrival.x() == kNever; }

ReachBank::Family ReachBank::family(const std::vector<double>& times, double vertical, double rate,
                                    const Vector3d& deviation, bool toward) {
  Family motions;
  motions.toward = toward;
  for (const double time : times) {
    motions.times.emplace_back(time, time, vertical * time);
    motions.log_rates.push_back(std::log(rate / static_cast<double>(times.size())));
    motions.variances.emplace_back(deviation.cwiseAbs2());
  }
  return motions;
}

ReachBank::Families ReachBank::familiesOf(const ReachSettings& s) {
  const double vertical = s.vertical_shares.back(), rate = s.correction_rate;
  const Vector3d one = Vector3d::Ones(), wide = s.wide_way * one, back = s.return_way * one;
  const auto append = [](Family& to, const Family& from) {
    to.times.insert(to.times.end(), from.times.begin(), from.times.end());
    to.log_rates.insert(to.log_rates.end(), from.log_rates.begin(), from.log_rates.end());
    to.variances.insert(to.variances.end(), from.variances.begin(), from.variances.end());
  };

  Families families;
  std::vector<double> likely;
  double sum = 0.0;
  for (const double time : s.reach_times) {
    const double away = std::log(time / s.reach_time) / s.reach_time_deviation;
    likely.push_back(std::exp(-0.5 * away * away));
    sum += likely.back();
  }
  families.reaches.toward = true;
  for (const double share : s.vertical_shares) {
    Family reaches = family(s.reach_times, share, 1.0, s.place_deviation, true);
    for (std::size_t i = 0; i < likely.size(); ++i) {
      reaches.log_rates[i] = std::log(s.handover_rate * likely[i] / sum /
                                      static_cast<double>(s.vertical_shares.size()));
    }
    append(families.reaches, reaches);
  }
  families.others = family(s.small_times, vertical, s.other_rate / 2, s.small_way * one, false);
  append(families.others, family(s.wide_times, vertical, s.other_rate / 2, wide, false));
  families.turned = families.others;
  for (double& log_rate : families.turned.log_rates) log_rate += std::log(rate / s.other_rate);
  families.corrected = family(s.correction_times, vertical, rate, s.correction_way * one, true);
  families.joined = family(s.correction_times, vertical, rate, s.place_deviation, true);
  families.withdrawn = family(s.wide_times, vertical, rate, wide, false);
  families.left = family(s.wide_times, vertical, rate / 2, wide, false);
  families.retreated = family(s.wide_times, vertical, rate / 2, back, false);
  families.returned = family(s.wide_times, vertical, s.return_rate, back, false);
  return families;
}

ReachBank::ReachBank(double stamp, const Vector3d& position, const ReachSettings& settings)
    : settings_(settings), families_(familiesOf(settings)), stamp_(stamp), home_(position) {
  const ReachSettings& s = settings_;
  const double ratio = s.handover_rate / (s.handover_rate + s.other_rate);
  const Vector3d away = position - s.place;
  const double at_place = ratio * density(away, s.place_deviation);
  const double elsewhere = (1.0 - ratio) * density(away, Vector3d::Constant(0.5));
  // The arrival of a hand that is observed for the first time was not observed. So rest at a
  // handover gets half of its probability.
  const double share = 0.5 * at_place / (at_place + elsewhere);
  Hypothesis rest;
  rest.mean.setZero();
  rest.mean.row(kPosition) = rest.mean.row(kEnd) = position.transpose();
  Covariance covariance = Covariance::Zero();
  const double noise = s.noise * s.noise;
  for (const State i : {kPosition, kEnd}) {
    for (const State j : {kPosition, kEnd}) covariance(i, j) = noise;
    covariance(kError, i) = covariance(i, kError) = -0.5 * noise;
  }
  covariance(kError, kError) = noise;
  rest.covariance.fill(covariance);
  rest.begin = rest.onset = stamp;
  rest.arrival = Vector3d::Constant(kNever);
  rest.toward = true;
  rest.log_weight = std::log(std::max(share, 1e-9));
  all_.push_back(rest);
  rest.toward = false;
  rest.log_weight = std::log(1.0 - share);
  all_.push_back(rest);
}

double ReachBank::handover() const {
  double sum = 0.0;
  for (const Hypothesis& one : all_)
    if (one.toward) sum += std::exp(one.log_weight);
  return sum;
}

Vector3d ReachBank::position() const {
  Vector3d position = Vector3d::Zero();
  for (const Hypothesis& one : all_)
    position += std::exp(one.log_weight) * one.mean.row(kPosition).transpose();
  return position;
}

Vector3d ReachBank::velocity() const {
  Vector3d velocity = Vector3d::Zero();
  for (const Hypothesis& one : all_)
    velocity += std::exp(one.log_weight) * one.mean.row(kVelocity).transpose();
  return velocity;
}

std::optional<Prediction> ReachBank::prediction() const {
  std::vector<std::pair<double, const Hypothesis*>> toward;
  double top = kNever, sum = 0.0;
  for (const Hypothesis& one : all_)
    if (one.toward) top = std::max(top, one.log_weight);
  for (const Hypothesis& one : all_) {
    if (!one.toward) continue;
    toward.emplace_back(std::exp(one.log_weight - top), &one);
    sum += toward.back().first;
  }
  if (toward.empty()) return std::nullopt;
  Prediction prediction;
  for (auto& [weight, one] : toward) {
    weight /= sum;
    prediction.end += weight * one->mean.row(kEnd).transpose();
    prediction.arrival += weight * std::max(one->arrival.maxCoeff(), stamp_);
    prediction.onset += weight * one->onset;
  }
  double variance = 0.0;
  for (const auto& [weight, one] : toward) {
    const Vector3d away = one->mean.row(kEnd).transpose() - prediction.end;
    prediction.covariance += weight * away * away.transpose();
    for (int axis = 0; axis < 3; ++axis)
      prediction.covariance(axis, axis) += weight * one->covariance[axis](kEnd, kEnd);
    const double late = std::max(one->arrival.maxCoeff(), stamp_) - prediction.arrival;
    variance += weight * late * late;
  }
  prediction.arrival_deviation = std::sqrt(variance);
  return prediction;
}

bool ReachBank::step(double stamp, const Vector3d& position) {
  const double gap = stamp - stamp_;
  spawn(stamp);
  predict(stamp);
  std::vector<double> weights;
  weights.reserve(all_.size());
  for (const Hypothesis& one : all_) {
    Vector3d innovation, variance;
    compare(one, position, innovation, variance);
    weights.push_back(one.log_weight - 0.5 * (innovation.cwiseAbs2().cwiseQuotient(variance).sum() +
                                              (2.0 * M_PI * variance).array().log().sum()));
  }
  const double evidence = logSum(weights, [](double weight) { return weight; });
  seen_ = evidence > std::log(seen_ ? settings_.clutter_density : settings_.clutter_again);
  if (seen_) {
    update(position);
    for (std::size_t i = 0; i < all_.size(); ++i) all_[i].log_weight = weights[i];
  }
  mergeRest();
  prune();
  double share = 0.0;
  for (const Hypothesis& one : all_)
    if (one.resting() && !one.toward) share += std::exp(one.log_weight);
  share *= 1.0 - std::exp(-gap / settings_.home_time);
  home_ += share * (this->position() - home_);
  return seen_;
}

void ReachBank::forget() {
  for (Hypothesis& one : all_) one.toward = false;
  mergeRest();
}

/// Adds motions that began since the last observation: from rest, and changes of motions in
/// progress.
void ReachBank::spawn(double stamp) {
  const double gap = stamp - stamp_, every = std::max(kSpawnStep, gap / 8.0);
  const int times = std::max(0, static_cast<int>(std::ceil(gap / every)));
  const std::size_t count = all_.size();
  std::array<std::optional<std::size_t>, 2> likeliest;  // of the moving ones: others, toward
  for (std::size_t i = 0; i < count; ++i) {
    const bool toward = all_[i].toward;
    if (!all_[i].resting()) {
      auto& best = likeliest[toward ? 1 : 0];
      if (!best || all_[i].log_weight > all_[*best].log_weight) best = i;
      continue;
    }
    const Vector3d here = all_[i].mean.row(kPosition).transpose();
    for (int k = 0; k < times; ++k) {
      const double begin = stamp_ + k * every, during = gap / times;
      if (toward) {
        add(i, begin, families_.corrected, here, during);
        add(i, begin, families_.left, here, during);
        add(i, begin, families_.retreated, home_, during);
      } else {
        add(i, begin, families_.reaches, settings_.place, during);
        add(i, begin, families_.others, here, during);
        if ((here - home_).norm() > 2.0 * settings_.return_way)
          add(i, begin, families_.returned, home_, during);
      }
    }
  }
  if (const auto moving = likeliest[1]) {
    const Vector3d here = all_[*moving].mean.row(kPosition).transpose();
    const Vector3d end = all_[*moving].mean.row(kEnd).transpose();
    add(*moving, stamp_, families_.corrected, end, gap);
    add(*moving, stamp_, families_.withdrawn, here, gap);
  }
  if (const auto moving = likeliest[0]) {
    const Vector3d here = all_[*moving].mean.row(kPosition).transpose();
    add(*moving, stamp_, families_.joined, settings_.place, gap);
    add(*moving, stamp_, families_.turned, here, gap);
  }
}

void ReachBank::add(std::size_t source, double begin, const Family& family, const Vector3d& end,
                    double during) {
  for (std::size_t k = 0; k < family.times.size(); ++k) {
    Hypothesis born = all_[source];
    born.mean.row(kEnd) = end.transpose();
    for (int axis = 0; axis < 3; ++axis) {
      born.covariance[axis].row(kEnd).setZero();
      born.covariance[axis].col(kEnd).setZero();
      born.covariance[axis](kEnd, kEnd) = family.variances[k][axis];
    }
    born.begin = begin;
    // The onset of a changed reach is the onset of the original one.
    if (!born.toward || !family.toward) born.onset = begin;
    born.arrival = Vector3d::Constant(begin) + family.times[k];
    born.toward = family.toward;
    born.log_weight += family.log_rates[k] + std::log(during);
    all_.push_back(born);
  }
}

void ReachBank::predict(double stamp) {
  const double keep = std::exp(-(stamp - stamp_) / settings_.noise_time);
  for (Hypothesis& one : all_) predict(one, stamp, keep);
  stamp_ = stamp;
}

void ReachBank::predict(Hypothesis& one, double stamp, double keep) const {
  const ReachSettings& s = settings_;
  const bool resting = one.resting();
  // A motion that began after the last observation has only moved since its onset.
  const double since = resting ? stamp - stamp_ : stamp - std::max(stamp_, one.begin);
  // Equal for all hypotheses of rest: otherwise the one that fits a still hand better would win in
  // time.
  const double wander =
      since * (resting ? s.rest_wander * s.rest_wander : s.end_wander * s.end_wander);
  bool over = false;
  Transition moves;
  for (int axis = 0; axis < 3; ++axis) {
    if (axis != 1) {  // both horizontal axes have the same duration
      const double remaining = resting ? 0.0 : one.arrival[axis] - (stamp - since);
      over = endsWithin(remaining, since);
      moves = transition(remaining, since);
    }
    auto mean = one.mean.col(axis);
    const Vector3d moved = moves * mean.head<4>();
    mean.head<3>() = moved;
    mean[kError] *= keep;

    Covariance& c = one.covariance[axis];
    Eigen::Matrix<double, 3, kStates> half = moves * c.topRows<4>();
    half.col(kError) *= keep;
    c.topLeftCorner<3, 3>() = half.leftCols<4>() * moves.transpose();
    c.topRightCorner<3, 2>() = half.rightCols<2>();
    c.bottomLeftCorner<2, 3>() = half.rightCols<2>().transpose();
    c(kEnd, kError) = c(kError, kEnd) *= keep;
    c(kError, kError) = keep * keep * c(kError, kError) + s.noise * s.noise * (1.0 - keep * keep);
    c(kEnd, kEnd) += wander;
    if (over) {
      c(kPosition, kPosition) += wander;
      c(kPosition, kEnd) = c(kEnd, kPosition) += wander;
      continue;
    }
    // A random walk of the acceleration, integrated.
    double bent = s.acceleration_wander * s.acceleration_wander * since;
    c(kAcceleration, kAcceleration) += bent;
    bent *= since;
    c(kVelocity, kAcceleration) = c(kAcceleration, kVelocity) += bent / 2.0;
    bent *= since;
    c(kPosition, kAcceleration) = c(kAcceleration, kPosition) += bent / 6.0;
    c(kVelocity, kVelocity) += bent / 3.0;
    bent *= since;
    c(kPosition, kVelocity) = c(kVelocity, kPosition) += bent / 8.0;
    bent *= since;
    c(kPosition, kPosition) += bent / 20.0;
  }
}

void ReachBank::compare(const Hypothesis& one, const Vector3d& position, Vector3d& innovation,
                        Vector3d& variance) {
  innovation = position - (one.mean.row(kPosition) + one.mean.row(kError)).transpose();
  for (int axis = 0; axis < 3; ++axis) {
    const Covariance& c = one.covariance[axis];
    variance[axis] =
        c(kPosition, kPosition) + 2.0 * c(kPosition, kError) + c(kError, kError) + 1e-8;
  }
}

void ReachBank::update(const Vector3d& position) {
  for (Hypothesis& one : all_) {
    Vector3d innovation, variance;
    compare(one, position, innovation, variance);
    for (int axis = 0; axis < 3; ++axis) {
      Covariance& c = one.covariance[axis];
      const Eigen::Matrix<double, kStates, 1> seen = c.col(kPosition) + c.col(kError);
      const Eigen::Matrix<double, kStates, 1> gain = seen / variance[axis];
      one.mean.col(axis) += gain * innovation[axis];
      c -= gain * seen.transpose();
    }
  }
}

/// Merges all completed motions of a kind into one rest of that kind, with their mean and
/// covariance.
void ReachBank::mergeRest() {
  const auto over = [this](const Hypothesis& one) {
    return one.arrival.maxCoeff() <= stamp_ + 1e-9;
  };
  for (const bool toward : {true, false}) {
    std::vector<const Hypothesis*> these;
    for (const Hypothesis& one : all_)
      if (one.toward == toward && over(one)) these.push_back(&one);
    if (these.empty()) continue;
    Hypothesis rest = *these.front();
    if (these.size() > 1) {
      rest.log_weight = logSum(these, [](const Hypothesis* one) { return one->log_weight; });
      rest.mean.setZero();
      rest.covariance.fill(Covariance::Zero());
      rest.onset = 0.0;
      std::vector<double> weights;
      for (const Hypothesis* one : these) {
        weights.push_back(std::exp(one->log_weight - rest.log_weight));
        rest.mean += weights.back() * one->mean;
        rest.onset += weights.back() * one->onset;
      }
      for (std::size_t i = 0; i < these.size(); ++i) {
        const Eigen::Matrix<double, kStates, 3> spread = these[i]->mean - rest.mean;
        for (int axis = 0; axis < 3; ++axis) {
          rest.covariance[axis] += weights[i] * (these[i]->covariance[axis] +
                                                 spread.col(axis) * spread.col(axis).transpose());
        }
      }
    }
    rest.begin = stamp_;
    rest.arrival = Vector3d::Constant(kNever);
    const auto first = all_.begin() + (these.front() - all_.data());
    *first = rest;
    all_.erase(
        std::remove_if(first + 1, all_.end(),
                       [&](const Hypothesis& one) { return one.toward == toward && over(one); }),
        all_.end());
  }
}

/// Drops unlikely hypotheses and normalises the weights.
void ReachBank::prune() {
  double top = kNever;
  for (const Hypothesis& one : all_) top = std::max(top, one.log_weight);
  std::vector<double> weights;
  for (const Hypothesis& one : all_)
    if (one.log_weight > top - kUnlikely) weights.push_back(one.log_weight);
  double least = top - kUnlikely;
  std::size_t ties = 0;  // how many of exactly the least weight are kept
  if (const std::size_t most = settings_.hypotheses; weights.size() > most) {
    const auto last = weights.begin() + static_cast<std::ptrdiff_t>(most) - 1;
    std::nth_element(weights.begin(), last, weights.end(), std::greater<>());
    least = *last;
    ties = static_cast<std::size_t>(std::count(weights.begin(), last + 1, least));
  }
  all_.erase(std::remove_if(all_.begin(), all_.end(),
                            [&](const Hypothesis& one) {
                              if (one.log_weight != least) return !(one.log_weight > least);
                              if (ties == 0) return true;
                              --ties;
                              return false;
                            }),
             all_.end());
  const double total = logSum(all_, [](const Hypothesis& one) { return one.log_weight; });
  for (Hypothesis& one : all_) one.log_weight -= total;
}

}  // namespace coglab_perception
