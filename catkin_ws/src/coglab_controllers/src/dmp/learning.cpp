#include "coglab_controllers/dmp/learning.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/QR>

#include "coglab_controllers/dmp/dmp.hpp"

namespace coglab_controllers {
namespace {

// Integration steps per duration.
constexpr int kGridSteps = 600;
// Time for which a motion must stay at the goal after its end, in durations, and the weight of this
// part relative to the motion.
constexpr double kHoldShare = 0.3, kHoldWeight = 0.3;
// A demonstration is at rest at an end if it is slower than this share of its mean speed, over this
// share of its samples. Noise must not be learnt as a start velocity.
constexpr double kRestingSpeed = 0.1, kRestingWindow = 0.05;

// One demonstration, prepared: time from its start, the goal is its last point.
struct Example {
  Eigen::VectorXd times;
  Eigen::Matrix3Xd positions;
  double duration;
  double scale;  // length of the path, m
  bool starts_at_rest, ends_at_rest;
};

// Response of the linear system to each of its inputs, one column each: the basis functions, the
// goal (times w), the start (times 1 - w and as initial position), the start velocity.
class Responses {
 public:
  Responses(const Primitive& primitive, double duration)
      : primitive_(primitive), step_(duration / kGridSteps), count_(primitive.basisCount()) {
    const int columns = count_ + 3;
    const int steps = static_cast<int>(std::ceil((1.0 + kHoldShare) * kGridSteps)) + 1;
    positions_.resize(steps + 1, columns);
    velocities_.resize(steps + 1, columns);
    Eigen::RowVectorXd x = Eigen::RowVectorXd::Zero(columns), v = x;
    x[count_ + 1] = 1.0;
    v[count_ + 2] = duration;  // v = tau * x', for x' = 1 m/s
    positions_.row(0) = x;
    velocities_.row(0) = v / duration;
    const double b = 1.0 / kGridSteps, a = 0.5 * b;
    Eigen::RowVectorXd f0 = inputs(0.0);
    for (int i = 0; i < steps; ++i) {
      const Eigen::RowVectorXd f1 = inputs((i + 0.5) * b), f2 = inputs((i + 1) * b);
      const Eigen::RowVectorXd kx1 = v, kv1 = slope(f0, x, v);
      const Eigen::RowVectorXd kx2 = v + a * kv1, kv2 = slope(f1, x + a * kx1, kx2);
      const Eigen::RowVectorXd kx3 = v + a * kv2, kv3 = slope(f1, x + a * kx2, kx3);
      const Eigen::RowVectorXd kx4 = v + b * kv3, kv4 = slope(f2, x + b * kx3, kx4);
      x += b / 6.0 * (kx1 + 2.0 * kx2 + 2.0 * kx3 + kx4);
      v += b / 6.0 * (kv1 + 2.0 * kv2 + 2.0 * kv3 + kv4);
      positions_.row(i + 1) = x;
      velocities_.row(i + 1) = v / duration;
      f0 = f2;
    }
  }

  // Responses at a time, by cubic interpolation on the grid.
  Eigen::RowVectorXd at(double t) const {
    const int last = static_cast<int>(positions_.rows()) - 2;
    const int i = std::clamp(static_cast<int>(t / step_), 0, last);
    const double u = t / step_ - i, r = 1.0 - u;
    return (1.0 + 2.0 * u) * r * r * positions_.row(i) +
           u * u * (3.0 - 2.0 * u) * positions_.row(i + 1) +
           step_ * u * r * (r * velocities_.row(i) - u * velocities_.row(i + 1));
  }

 private:
  Eigen::RowVectorXd inputs(double time) const {  // time in durations
    const double s = std::exp(-primitive_.alpha * time), w = primitive_.goal_weight(s);
    Eigen::RowVectorXd result = Eigen::RowVectorXd::Zero(count_ + 3);
    const Eigen::ArrayXd exponent =
        -primitive_.widths.array() * (s - primitive_.centres.array()).square();
    const Eigen::ArrayXd psi = (exponent - exponent.maxCoeff()).exp();
    result.head(count_) = ((1.0 - w) * primitive_.stiffness / psi.sum() * psi).matrix().transpose();
    result[count_] = w * primitive_.stiffness;
    result[count_ + 1] = (1.0 - w) * primitive_.stiffness;
    return result;
  }
  Eigen::RowVectorXd slope(const Eigen::RowVectorXd& f, const Eigen::RowVectorXd& x,
                           const Eigen::RowVectorXd& v) const {
    return f - primitive_.stiffness * x - primitive_.damping * v;
  }

  const Primitive& primitive_;
  double step_;
  int count_;
  Eigen::MatrixXd positions_, velocities_;
};

Example prepare(const Trajectory& trajectory) {
  Example example;
  const Eigen::Index count = trajectory.positions.cols();
  example.times = Eigen::Map<const Eigen::VectorXd>(trajectory.times.data(), count).array() -
                  trajectory.times[0];
  example.positions = trajectory.positions;
  example.duration = example.times[count - 1];
  example.scale = 0.0;
  for (Eigen::Index i = 1; i < count; ++i) {
    example.scale += (example.positions.col(i) - example.positions.col(i - 1)).norm();
  }
  if (example.scale < 1e-4) {
    throw std::invalid_argument("expected a path of at least 0.1 mm, got one of " +
                                std::to_string(example.scale) + " m");
  }
  const auto window = std::max<Eigen::Index>(
      1, static_cast<Eigen::Index>(kRestingWindow * static_cast<double>(count)));
  const auto rests = [&](Eigen::Index from, Eigen::Index to) {
    const double way = (example.positions.col(to) - example.positions.col(from)).norm();
    const double time = example.times[to] - example.times[from];
    return way / time < kRestingSpeed * example.scale / example.duration;
  };
  example.starts_at_rest = rests(0, window);
  example.ends_at_rest = rests(count - 1 - window, count - 1);
  return example;
}

// Throws for a fault unless its name is allowed.
class Faults {
 public:
  explicit Faults(const std::vector<std::string>& allow) : allow_(allow) {
    const char* names[] = {"short", "brief", "jump", "moving", "noisy"};
    for (const std::string& name : allow) {
      if (std::find(std::begin(names), std::end(names), name) != std::end(names)) continue;
      throw std::invalid_argument("allow: expected short, brief, jump, moving or noisy, got '" +
                                  name + "'");
    }
  }
  void refuse(const std::string& name, const std::string& what, double value,
              const std::string& expected) const {
    if (std::find(allow_.begin(), allow_.end(), name) != allow_.end()) return;
    throw std::invalid_argument(name + ": " + what + " " + std::to_string(value) + ", expected " +
                                expected + "; cut it, record it again, or allow '" + name + "'");
  }

 private:
  const std::vector<std::string>& allow_;
};

// Noise of the positions, m, from fourth differences, which are small for a smooth path.
double noiseOf(const Eigen::Matrix3Xd& p) {
  const Eigen::Index n = p.cols() - 4;
  const Eigen::Matrix3Xd fourth = p.leftCols(n) - 4.0 * p.middleCols(1, n) +
                                  6.0 * p.middleCols(2, n) - 4.0 * p.middleCols(3, n) +
                                  p.rightCols(n);
  return std::sqrt(fourth.squaredNorm() / (70.0 * static_cast<double>(n)));
}

// Refuses a demonstration that is not one reach; see DemonstrationLimits.
void checkReach(const Example& example, const Faults& faults) {
  using Limits = DemonstrationLimits;
  const Eigen::Matrix3Xd& p = example.positions;
  const Eigen::Index last = p.cols() - 1;
  const double far = (p.colwise() - p.col(0)).colwise().norm().maxCoeff();
  if (far < Limits::kShort)
    faults.refuse("short", "its farthest point from its start (m) is", far, "at least 0.05");
  if (example.duration < Limits::kBrief)
    faults.refuse("brief", "its duration (s) is", example.duration, "at least 0.25");
  const Eigen::VectorXd steps = (p.rightCols(last) - p.leftCols(last)).colwise().norm();
  for (Eigen::Index i = 0; i < last; ++i) {
    const double speed = steps[i] / (example.times[i + 1] - example.times[i]);
    if (speed > Limits::kJump)
      faults.refuse("jump", "between two samples its speed (m/s) is", speed, "at most 5");
    const Eigen::Index from = std::max<Eigen::Index>(0, i - 3), to = std::min(last - 1, i + 3);
    const double around = (steps.segment(from, to - from + 1).sum() - steps[i]) /
                          static_cast<double>(std::max<Eigen::Index>(1, to - from));
    if (steps[i] > 0.2 * far && steps[i] > Limits::kJumpShare * around)
      faults.refuse("jump", "it has a step (m) of", steps[i], "steps like those around it");
  }
  const auto window = (last + 1) / 20;
  if (window == 0) return;  // too few samples for speeds at the ends, and for noise
  const double mean = example.scale / example.duration;
  for (const Eigen::Index from : {Eigen::Index(0), last - window}) {
    const double speed = (p.col(from + window) - p.col(from)).norm() /
                         (example.times[from + window] - example.times[from]);
    if (speed > Limits::kMoving * mean) {
      faults.refuse("moving",
                    from == 0 ? "its speed (m/s) at its start is" : "its speed (m/s) at its end is",
                    speed, "at most half its mean speed, " + std::to_string(mean));
    }
  }
  const double noise = noiseOf(p);
  if (noise > Limits::kNoisy * far)
    faults.refuse("noisy", "its noise (m) is", noise, "at most 2 % of the way it goes");
}

// Maps and shifts the example so that its start and goal are those of the reference.
void alignTo(const Example& reference, ShapeMapping mapping, Example& example) {
  const auto line = [](const Example& e) -> Vector3 {
    return e.positions.rightCols<1>() - e.positions.leftCols<1>();
  };
  if (line(example).norm() < 1e-3 || line(reference).norm() < 1e-3) return;
  const Matrix3 map = shapeMap(mapping, line(example), line(reference));
  const Vector3 start = example.positions.col(0), reference_start = reference.positions.col(0);
  example.scale *= line(reference).norm() / line(example).norm();
  example.positions =
      ((map * (example.positions.colwise() - start)).colwise() + reference_start).eval();
}

void check(const LearningOptions& options) {
  if (options.basis_count < 2 || options.basis_count > kMaxBasis) {
    throw std::invalid_argument("basis_count: expected 2 to " + std::to_string(kMaxBasis) +
                                ", got " + std::to_string(options.basis_count));
  }
  if (!(options.regularisation >= 0.0 && options.regularisation <= 1.0)) {
    throw std::invalid_argument("regularisation: expected 0 to 1, got " +
                                std::to_string(options.regularisation));
  }
}

std::vector<Example> prepareAll(const std::vector<Trajectory>& demonstrations,
                                const LearningOptions& options) {
  const ShapeMapping mapping = options.mapping;
  const Faults faults(options.allow);
  if (demonstrations.empty())
    throw std::invalid_argument("expected at least one demonstration, got none");
  std::vector<Example> examples;
  for (std::size_t i = 0; i < demonstrations.size(); ++i) {
    try {
      validate(demonstrations[i]);
      examples.push_back(prepare(demonstrations[i]));
      checkReach(examples.back(), faults);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument("demonstration " + std::to_string(i + 1) + ": " + error.what());
    }
    if (mapping != ShapeMapping::None && i > 0) alignTo(examples.front(), mapping, examples.back());
  }
  return examples;
}

// The primitive without its weights: mean duration, start and goal of the examples.
Primitive withoutWeights(const std::string& id, const std::vector<Example>& examples,
                         const LearningOptions& options) {
  Primitive primitive;
  primitive.id = id;
  primitive.alpha = CanonicalSystem(options.alpha).alpha();
  primitive.stiffness = options.stiffness;
  primitive.damping = 2.0 * std::sqrt(options.stiffness);
  primitive.goal_weight = options.goal_weight;
  primitive.mapping = options.mapping;
  primitive.duration = 0.0;
  placeBasis(options.basis_count, primitive.alpha, primitive.centres, primitive.widths);
  const double share = 1.0 / static_cast<double>(examples.size());
  for (const Example& example : examples) {
    primitive.duration += share * example.duration;
    primitive.start += share * example.positions.leftCols<1>();
    primitive.goal += share * example.positions.rightCols<1>();
  }
  primitive.weights = Eigen::Matrix3Xd::Zero(3, options.basis_count);
  validate(primitive);
  return primitive;
}

// Least squares. Unknowns: the weights, and the start velocity of each demonstration. For a
// demonstration from rest this column is zero and gives zero.
class Equations {
 public:
  Equations(const Primitive& primitive, const std::vector<Example>& examples)
      : n_(primitive.basisCount()) {
    const Eigen::Index unknowns = n_ + static_cast<Eigen::Index>(examples.size());
    Eigen::Index rows = unknowns;
    for (const Example& example : examples) {
      rows += example.times.size() + (example.ends_at_rest ? kHolds : 0);
    }
    a_ = Eigen::MatrixXd::Zero(rows, unknowns);
    b_ = Eigen::MatrixX3d::Zero(rows, 3);
    for (std::size_t k = 0; k < examples.size(); ++k) {
      add(examples[k], n_ + static_cast<Eigen::Index>(k),
          Responses(primitive, examples[k].duration));
    }
  }

  // One row per unknown: the weights first, then the start velocities.
  Eigen::MatrixX3d solve(double regularisation) {
    const double ridge =
        std::sqrt(regularisation * a_.leftCols(n_).squaredNorm() / static_cast<double>(n_));
    for (Eigen::Index i = 0; i < n_; ++i) a_(row_ + i, i) = ridge;
    return a_.colPivHouseholderQr().solve(b_);
  }

 private:
  static constexpr int kHolds = kGridSteps / 10;  // rows that require a motion to stay at its goal

  void add(const Example& example, Eigen::Index velocity_column, const Responses& responses) {
    const Eigen::RowVector3d start = example.positions.leftCols<1>().transpose();
    const Eigen::RowVector3d goal = example.positions.rightCols<1>().transpose();
    const auto row = [&](double t, const Eigen::RowVector3d& position, double weight) {
      const Eigen::RowVectorXd response = responses.at(t);
      a_.row(row_).head(n_) = weight * response.head(n_);
      if (!example.starts_at_rest) a_(row_, velocity_column) = weight * response[n_ + 2];
      b_.row(row_) = weight * (position - response[n_] * goal - response[n_ + 1] * start);
      ++row_;
    };
    const double weight =
        1.0 / (example.scale * std::sqrt(static_cast<double>(example.times.size())));
    for (Eigen::Index i = 0; i < example.times.size(); ++i) {
      row(example.times[i], example.positions.col(i).transpose(), weight);
    }
    if (!example.ends_at_rest) return;
    const double hold_weight =
        kHoldWeight / (example.scale * std::sqrt(static_cast<double>(kHolds)));
    for (int i = 1; i <= kHolds; ++i)
      row(example.duration * (1.0 + kHoldShare * i / kHolds), goal, hold_weight);
  }

  Eigen::Index n_, row_ = 0;
  Eigen::MatrixXd a_;
  Eigen::MatrixX3d b_;
};

}  // namespace

Primitive learn(const std::string& id, const std::vector<Trajectory>& demonstrations,
                const LearningOptions& options) {
  check(options);
  const std::vector<Example> examples = prepareAll(demonstrations, options);
  Primitive primitive = withoutWeights(id, examples, options);
  const Eigen::MatrixX3d solution = Equations(primitive, examples).solve(options.regularisation);
  const Eigen::Index n = primitive.basisCount();
  primitive.weights = solution.topRows(n).transpose();
  primitive.start_velocity = solution.bottomRows(solution.rows() - n).colwise().mean().transpose();
  validate(primitive);
  return primitive;
}

Eigen::Matrix3Xd reproduce(const Primitive& primitive, const std::vector<double>& times,
                           double dt) {
  Dmp dmp(primitive);
  dmp.start(primitive.start, primitive.start_velocity, primitive.goal, 1.0);
  Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(times.size()));
  const double begin = times.empty() ? 0.0 : times.front();
  double now = 0.0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double until = times[i] - begin;
    while (until - now > 1e-12) {
      const double step = std::min(dt, until - now);
      dmp.step(step, primitive.goal);
      now += step;
    }
    result.col(static_cast<Eigen::Index>(i)) = dmp.state().position;
  }
  return result;
}

}  // namespace coglab_controllers
