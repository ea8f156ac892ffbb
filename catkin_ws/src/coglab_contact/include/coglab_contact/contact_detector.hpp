/// @file
/// Contact and release in the estimated external joint torques of an arm at rest (D4.10, 3.2).
///
/// Contact: the change of the low-passed torque within a short window, so that the bias of the
/// estimate cancels. It is compared with a threshold learnt at rest, on the joints that are
/// sensitive to forces across the line from person to robot. Load and release: the vertical force
/// that explains the change of torque is compared with a share of the object's weight. Load counts
/// from the torque before the contact, release from the torque on arming.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "coglab_contact/evidence.hpp"
#include "coglab_contact/ring.hpp"
#include "coglab_contact/types.hpp"

namespace coglab_contact {

/// Settings; coglab_contact.detector.DetectorSettings documents them and has the defaults.
struct DetectorSettings {
  double cutoff, window, still_speed, settle, k;
  int confirm, learn_samples;
  double floor, offset_threshold, sensitivity_share, load_share, release_confirm, load_confirm;
  Vector3 user_direction;
};

/// Joint torques (Nm) at rest. Pushing a resting arm and releasing it is a jolt, not a motion. The
/// torque during a jolt does not count as rest without touch.
class RestTorque {
 public:
  /// The arm moves with `velocity` (rad/s), `gap` s after the previous sample.
  void move(double gap, const Joints& velocity);
  /// True during a motion that is larger than a jolt.
  bool travels() const;
  /// The arm has just stopped.
  void stand();
  /// Adds a torque (Nm) of an arm that has stood for a while, `gap` s after the previous sample.
  void learn(const Joints& torque, double gap);
  /// Torque at the last rest before a motion larger than a jolt; none: there was none.
  const std::optional<Joints>& beforeMotion() const { return before_motion_; }

 private:
  std::optional<Joints> before_motion_, here_, left_;
  std::optional<Joints> travelled_;  // rad, distance since the last rest; none: at rest
};

/// Request of the service `arm`: the event to detect.
struct Request {
  std::string mode;         ///< contact, load or release
  double now = 0.0;         ///< s
  double timeout = 0.0;     ///< s
  double k = 0.0;           ///< threshold in standard deviations; 0: that of the settings
  std::vector<int> joints;  ///< 1..7; empty: the sensitive joints
  double mass = 0.0;        ///< kg
  double load_share = 0.0;  ///< 0: that of the settings
  /// The arm carries an object. After each motion its torque differs, so the offset against the
  /// previous rest is not checked.
  bool carries = false;
};

/// Processes every torque sample. Returns at most one event per arming. Works only while the arm
/// stands still, and checks that itself. Times in s on one clock. A sample without an event
/// allocates nothing.
class ContactDetector {
 public:
  ContactDetector(const DetectorSettings& settings, JacobianAt jacobian);

  /// Uses these settings from the next sample on. An armed request keeps its k and load share.
  /// `cutoff`, `window` and `learn_samples` do not change: the learnt noise depends on them.
  void tune(const DetectorSettings& settings);

  /// Watches as soon as the arm stands still.
  /// @throws std::invalid_argument for an invalid request.
  void arm(const Request& request);
  /// Stops watching.
  void disarm() { armed_.reset(); }
  /// Deletes the noise at rest and learns it again from now on. Returns a sentence.
  /// @throws std::invalid_argument if the arm moves or the detector is armed.
  std::string learn();

  /// Processes one sample: torque (Nm), position (rad), velocity (rad/s). An impossible one is
  /// ignored.
  std::optional<ContactEvent> feed(double stamp, const Joints& torque, const Joints& position,
                                   const Joints& velocity);

  /// off, waiting (armed, but the arm moves or the rest was too short) or watching.
  const char* state() const;
  /// Mode for which it is armed; empty while it is off.
  std::string mode() const { return armed_ ? armed_->mode : ""; }
  /// True if the arm has stood still for the time of the settings.
  bool still() const;
  double margin() const { return margin_; }  ///< largest present signal over its threshold
  double k() const { return armed_ ? armed_->k : settings_.k; }
  /// Indices of the watched joints; empty while nothing is watched.
  std::vector<int> watched() const { return armed_ ? armed_->watched : std::vector<int>(); }
  std::size_t restSamples() const { return rest_differences_.size(); }
  /// Robust standard deviation (Nm) of the difference at rest; without data, the floor.
  Joints sigma() const;
  /// Nm, signed largest change within the window since the last call.
  Joints takeLargest();

 private:
  struct Armed {
    std::string mode;
    double until = 0.0, k = 0.0;
    std::vector<int> joints;
    double mass = 0.0, load_share = 0.0;
    bool carries = false;
    std::optional<Joints> baseline, before;  // before: baseline before a jolt of the arm
    std::vector<int> watched;
    Joints threshold = Joints::Zero();  // Nm
    int over = 0;
    std::optional<double> gone_since;
  };
  struct Filtered {
    double stamp = 0.0;
    Joints torque = Joints::Zero();
  };

  bool inTime(double stamp);
  void followMotion(double stamp, const Joints& velocity);
  std::optional<Joints> filter(double stamp, const Joints& torque);
  void keep(const Joints& difference);
  std::vector<int> sensitiveJoints(const PalmJacobian& jacobian) const;
  std::optional<ContactEvent> watch(double stamp, const Joints& difference, const Joints& position);
  std::optional<ContactEvent> checkOffset();
  std::optional<ContactEvent> watchWeight(double stamp, const Joints& position);

  DetectorSettings settings_;
  JacobianAt jacobian_;
  std::optional<Armed> armed_;
  std::optional<Joints> filtered_, unloaded_;
  Ring<Filtered> history_{64};
  Ring<Joints> rest_differences_{400};
  std::optional<double> last_stamp_, odd_stamp_, still_since_;
  RestTorque rest_;
  double gap_ = 0.0;  // s between the last two samples
  double margin_ = 0.0;
  Joints largest_ = Joints::Zero();
};

}  // namespace coglab_contact
