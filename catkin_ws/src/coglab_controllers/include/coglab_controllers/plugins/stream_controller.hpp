/// @file
/// Motion controllers that follow a stream: twists of the hand, poses of the hand, or joint
/// velocities.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "coglab_controllers/motion/motion_runner.hpp"
#include "coglab_rt/triple_buffer.hpp"

namespace coglab_controllers {

/// One command of a stream, for the control cycle.
struct StreamCommand {
  JointVector numbers = JointVector::Zero();  ///< a twist uses six; the seventh is 0
  std::int64_t stamp_ns = 0;                  ///< time of creation, MotionHost::now_ns()
  bool in_tool = false;                       ///< true: a twist in the axes of the tool frame
};

/// One command of a stream, from a user.
struct StreamMessage {
  std::vector<double> numbers;  ///< as defined by the kind of stream
  double age = 0.0;             ///< s since its creation; negative: from the future
  bool in_tool = false;         ///< true: a twist in the axes of the (turning) tool frame
};

/// Commands of a stream, from the sender to the control cycle. The cycle never waits for them.
using StreamMailbox = TripleBuffer<StreamCommand>;

/// Request that opens a stream.
struct StreamRequest {
  std::int64_t opened_ns = 0;  ///< older commands are ignored
};

/// The arm follows the newest command until the stream is closed: by a cancel, by a switch to
/// another controller, or because the robot stops. If no command came for `command_timeout`, the
/// arm brakes and stands, and the stream stays open for the next one. A limit slows the arm but
/// does not close the stream. `speed_scale` slows it like every motion.
///
/// Commands are scaled down to the largest speeds below, in the same direction, and changes of
/// velocity to the largest accelerations. The reference stays within `leash` of the commanded arm,
/// so it does not run ahead while a limit slows the arm. If several commands arrive within a cycle,
/// only the newest is used.
///
/// Parameters: those of MotionRunner without a queue, and `command_timeout` (s, default 0.1).
class StreamController : public MotionRunner<StreamRequest> {
 public:
  /// Opens the stream, or reopens it. Any thread.
  MotionAnswer open();
  /// Sends one command. Refused if the stream is not open, the size is wrong, a number is not
  /// finite, or the age is negative or above `command_timeout`. Any thread but the control thread.
  Answer send(const StreamMessage& message);
  Answer send(const std::vector<double>& numbers) { return send({numbers, 0.0, false}); }
  /// True while the stream is open.
  bool isOpen() const { return open_.load(std::memory_order_relaxed); }
  /// Newest progress; one reader thread.
  bool readProgress(MotionProgress& progress) { return progress_.read(progress); }
  const std::string& baseFrame() const { return setup().robot->chain.baseLink(); }
  const std::vector<std::string>& jointNames() const { return setup().robot->chain.jointNames(); }
  double commandTimeout() const { return timeout_; }  ///< s

  void configure(const MotionSetup& setup) override;
  void adopt(const CycleInput& input) override;

 protected:
  /// Parts of a kind of stream.
  struct Parts {
    std::unique_ptr<Motion<StreamRequest>> motion;
    StreamMailbox* mailbox;          ///< a member of the motion
    std::vector<std::string> names;  ///< of the numbers of a command
    std::string units;
    ReferenceLoop::Spaces spaces;  ///< of the reference
  };
  explicit StreamController(Parts parts);

 private:
  void report(std::int64_t stamp_ns) override;
  /// Further check of numbers with the right size. Returns the error, or an empty text.
  virtual std::string wrong(const std::vector<double>& /*numbers*/) const { return {}; }

  double timeout_ = 0.1;  // s
  coglab_rt::TripleBuffer<MotionProgress> progress_;
  StreamMailbox& mailbox_;
  const std::vector<std::string> names_;
  const std::string units_;
  std::mutex sending_;  // between senders; the cycle does not lock it
  std::atomic<bool> open_{false};
};

/// Follows twists of the tool frame: linear (m/s, of its origin), then angular (rad/s), in the axes
/// of the base frame or of the tool frame. Parameters besides those of StreamController:
/// `max_speed` (m/s, default 0.8, and at most 0.8 times `hand_speed_limit`), `max_turning`
/// (rad/s, 3.0), `max_acceleration` (m/s^2, 3.0), `max_turning_acceleration` (rad/s^2, 12.0),
/// `leash` (m, 0.02; for the orientation 10 times this number, in rad).
class TwistStream : public StreamController {
 public:
  TwistStream();
};

/// Follows poses of the tool frame in the base frame: position (m), then a unit quaternion
/// x y z w. The hand moves to the newest pose within the limits of TwistStream (same parameters).
/// Near the pose its speed is `gain` (1/s, default 10, tunable) times the distance. A position
/// outside the workspace is followed up to the border.
class PoseStream : public StreamController {
 public:
  PoseStream();

 private:
  std::string wrong(const std::vector<double>& numbers) const override;
};

/// Follows joint velocities (rad/s), seven in wire order. A joint near its stop brakes alone; the
/// others continue. Parameters besides those of StreamController: `max_share` (of the robot's
/// velocity limits, default 1.0), `max_acceleration_share` (of its acceleration limits, 0.5),
/// `leash` (rad, 0.05).
class JointVelocityStream : public StreamController {
 public:
  JointVelocityStream();
};

}  // namespace coglab_controllers
