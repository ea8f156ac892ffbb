/// @file
/// Motion controller that follows joint trajectories from planners.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "coglab_controllers/motion/joint_spline.hpp"
#include "coglab_controllers/motion/motion_runner.hpp"
#include "coglab_rt/triple_buffer.hpp"

namespace coglab_controllers {

/// Result codes for clients of control_msgs/FollowJointTrajectory, with the numbers of the action.
enum class TrajectoryError : int {
  None = 0,
  InvalidGoal = -1,
  InvalidJoints = -2,
  OldHeaderTimestamp = -3,
  PathToleranceViolated = -4,
  GoalToleranceViolated = -5
};

/// The goal of control_msgs/FollowJointTrajectory, without ROS.
struct TrajectoryRequest {
  struct Point {
    double time = 0.0;              ///< s from the start
    std::vector<double> positions;  ///< rad, in the order of joint_names
    /// rad/s and rad/s^2; empty in all points: chosen so that the joints do not overshoot. Without
    /// accelerations the path is a cubic spline, with them a quintic one.
    std::vector<double> velocities, accelerations;
  };
  struct Tolerance {
    std::string joint;
    double position = 0.0;      ///< rad; 0: the default, -1: no bound
    double velocity = 0.0;      ///< rad/s; 0 or -1: no bound
    double acceleration = 0.0;  ///< rad/s^2; 0, -1 or more; not used
  };

  std::vector<std::string> joint_names;  ///< all joints of the arm, in any order
  std::vector<Point> points;
  std::vector<Tolerance> path_tolerance, goal_tolerance;
  double goal_time_tolerance = 0.0;  ///< s; 0: parameter `goal_time`
  /// s since the stamp of the trajectory; 0 without a stamp; negative: s until it begins
  double age = 0.0;

  static constexpr std::size_t kMostPoints = 10000;
  static constexpr double kLongestWait = 60.0;  ///< s, largest lead of a stamp over the clock
};

struct TrajectoryAnswer : MotionAnswer {
  TrajectoryError error = TrajectoryError::None;
};

/// Largest differences to the set-point.
struct TrajectoryTolerance {
  JointVector position = JointVector::Constant(std::numeric_limits<double>::infinity());  ///< rad
  JointVector velocity = JointVector::Constant(std::numeric_limits<double>::infinity());  ///< rad/s
};

/// A checked trajectory. It does not change while the cycle follows it.
struct JointPath {
  JointSpline spline;
  TrajectoryTolerance path, goal;
  double goal_time = 2.0;  ///< s after the end until the arm is within `goal`
  std::uint64_t number = 0;
};

/// An accepted trajectory that begins at the time of its stamp.
struct WaitingTrajectory {
  TrajectoryRequest request;
  RequestStamp accepted;  ///< a later cancel or stop of the robot makes it void
};

/// Plan for the control cycle.
struct TrajectoryPlan {
  const JointPath* trajectory = nullptr;  ///< owned by the controller
};

/// Desired and actual state of the arm on a trajectory.
struct TrajectoryProgress {
  std::int64_t stamp_ns = 0;
  int id = -1;  ///< of the motion
  bool moving = false;
  JointPoint desired, actual;  ///< `actual` without acceleration
};

/// Follows one trajectory at a time. A new one replaces the running one during the motion. It
/// begins at the arm's set-point. The difference to its first point, at most `start_tolerance`,
/// fades out within half a second, or within the trajectory if that is shorter. A speed limit or
/// `speed_scale` makes the trajectory take longer, on the same path.
///
/// The motion ends if a joint leaves the path tolerance. It succeeds if all joints come within the
/// goal tolerance, at most `goal_time` after the end of the trajectory.
///
/// Parameters besides those of MotionRunner: `path_tolerance` (rad, default 0.2), `goal_tolerance`
/// (rad, 0.01), `goal_time` (s, 2), `start_tolerance` (rad, 0.05).
class JointTrajectory : public MotionRunner<TrajectoryPlan> {
 public:
  JointTrajectory();

  /// Checks whether a trajectory could begin if this controller were active: joints, sizes, times,
  /// limits, workspace, and the arm's position. The position is not checked for a trajectory that
  /// begins later (age < 0). Any thread.
  TrajectoryAnswer check(const TrajectoryRequest& request) const;
  /// Checks a trajectory that begins later. The caller keeps it until then. Any thread.
  TrajectoryAnswer accept(WaitingTrajectory& waiting);
  /// Checks a trajectory and begins it at once. Any thread.
  TrajectoryAnswer follow(const TrajectoryRequest& request);
  /// The same for a waiting trajectory; refused if it has become void.
  TrajectoryAnswer follow(const WaitingTrajectory& waiting);
  /// Result code for the client of an ended motion.
  static TrajectoryError errorOf(const EndedMotion& end);
  /// Newest progress; one reader thread.
  bool readProgress(TrajectoryProgress& progress) { return progress_.read(progress); }
  const std::vector<std::string>& jointNames() const { return setup().robot->chain.jointNames(); }

  void configure(const MotionSetup& setup) override;
  void computeReference(const CycleInput& input, References& references) override;

 private:
  void report(std::int64_t stamp_ns) override;
  TrajectoryAnswer read(const TrajectoryRequest& request, bool begins, JointPath& trajectory) const;
  TrajectoryAnswer begin(const TrajectoryRequest& request, const RequestStamp* accepted);

  double path_tolerance_ = 0.2, goal_tolerance_ = 0.01, start_tolerance_ = 0.05;  // rad
  double goal_time_ = 2.0;                                                        // s
  std::uint64_t made_ = 0;                       // under the host's request lock
  std::deque<std::unique_ptr<JointPath>> kept_;  // likewise; freed once a later one has begun
  coglab_rt::TripleBuffer<TrajectoryProgress> progress_;
};

}  // namespace coglab_controllers
