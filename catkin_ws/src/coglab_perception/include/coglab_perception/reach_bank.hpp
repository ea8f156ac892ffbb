/// @file
/// Estimates whether a hand moves to a handover and where it will rest: a bank of motion hypotheses
/// over observations.
///
/// Bayesian on-line change-point detection (Adams and MacKay 2007) with minimum-jerk motions. At
/// each observation new motions may have begun, with each duration of a grid, toward a handover or
/// toward any other place. Each hypothesis is a Kalman filter per axis. Its state is position,
/// velocity, acceleration, end of the motion and the slowly varying error of the tracker. Its
/// weight is the likelihood of all observations. A completed motion is rest, at a handover or
/// elsewhere.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace coglab_perception {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Prior knowledge about the hand: the fields of reach_bank.ReachSettings in Python, which explains
/// them and has the defaults. Lengths in m, times in s, rates in 1/s.
struct ReachSettings {
  Vector3d place, place_deviation;
  double handover_rate, other_rate;
  double reach_time, reach_time_deviation;
  std::vector<double> reach_times, small_times, wide_times;
  double small_way, wide_way;
  double return_rate, return_way, home_time;
  double correction_rate;
  std::vector<double> correction_times;
  double correction_way;
  std::vector<double> vertical_shares;
  double noise, noise_time;
  double rest_wander, acceleration_wander, end_wander;
  double clutter_density, clutter_again;
  std::size_t hypotheses;
};

/// Prediction from the motions toward a handover: place (m, mean and covariance) and stamp (s) at
/// which the hand comes to rest, and onset of the motion (s).
struct Prediction {
  Vector3d end = Vector3d::Zero();
  Matrix3d covariance = Matrix3d::Zero();
  double arrival = 0.0, arrival_deviation = 0.0, onset = 0.0;
};

/// Hypotheses for one hand. Call step() with each observation, in the order of stamps.
class ReachBank {
 public:
  /// Begins with a hand seen at `position` (m) at `stamp` (s).
  ReachBank(double stamp, const Vector3d& position, const ReachSettings& settings);

  /// Processes an observation. False if it does not show this hand or is impossible for a hand;
  /// then only the prediction to the stamp is done.
  bool step(double stamp, const Vector3d& position);
  /// Counts every motion toward a handover as another motion from now on.
  void forget();

  double stamp() const { return stamp_; }
  /// Probability that the hand moves toward a handover or waits at one, 0..1.
  double handover() const;
  /// Expected current position (m), without the tracker's error, and velocity (m/s).
  Vector3d position() const;
  Vector3d velocity() const;
  /// Empty if no hypothesis of a motion toward a handover is left.
  std::optional<Prediction> prediction() const;
  /// Number of hypotheses.
  std::size_t size() const { return all_.size(); }

 private:
  enum State { kPosition, kVelocity, kAcceleration, kEnd, kError, kStates };
  using Covariance = Eigen::Matrix<double, kStates, kStates>;

  /// A motion, with its filter for each axis.
  struct Hypothesis {
    Eigen::Matrix<double, kStates, 3> mean;  // one column per axis
    std::array<Covariance, 3> covariance;
    double begin, onset;  // s
    Vector3d arrival;     // s, end of the motion per axis
    bool toward;          // a handover
    double log_weight;

    bool resting() const;
  };

  /// Motions that may begin: durations (s), logarithms of their rates (1/s), and deviation of their
  /// ends (m).
  struct Family {
    std::vector<Vector3d> times;
    std::vector<double> log_rates;
    std::vector<Vector3d> variances;
    bool toward;
  };
  struct Families {
    Family reaches, others, turned, corrected, joined, withdrawn, left, retreated, returned;
  };

  static Family family(const std::vector<double>& times, double vertical, double rate,
                       const Vector3d& deviation, bool toward);
  static Families familiesOf(const ReachSettings& settings);
  void spawn(double stamp);
  /// Adds copies of a hypothesis as the motions of a family: onset (s), mean of their ends (m), and
  /// time (s) within which they could have begun.
  void add(std::size_t source, double begin, const Family& family, const Vector3d& end,
           double during);
  void predict(double stamp);
  void predict(Hypothesis& hypothesis, double stamp, double keep) const;
  void update(const Vector3d& position);
  void mergeRest();
  void prune();
  /// Difference of an observation to a hypothesis (m), and its variance (m^2), per axis.
  static void compare(const Hypothesis& hypothesis, const Vector3d& position, Vector3d& innovation,
                      Vector3d& variance);

  ReachSettings settings_;
  Families families_;
  std::vector<Hypothesis> all_;
  double stamp_;
  Vector3d home_;  // m, place of the hand's usual rest
  bool seen_ = true;
};

}  // namespace coglab_perception
