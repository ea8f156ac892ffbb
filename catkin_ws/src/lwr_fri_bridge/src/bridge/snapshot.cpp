// What the bridge shows of itself at the end of each tick.
#include "lwr_fri_bridge/bridge/snapshot.hpp"

#include <algorithm>
#include <iterator>

#include "lwr_fri_bridge/bridge/bridge.hpp"

namespace lwr_fri_bridge {

bool StateView::operator==(const StateView& o) const {
  return supervisor == o.supervisor && block == o.block && hold_latched == o.hold_latched &&
         blocking_joint == o.blocking_joint && motion_epoch == o.motion_epoch && loss == o.loss &&
         state == o.state && quality == o.quality && control == o.control && power == o.power &&
         drive_error == o.drive_error && drive_warning == o.drive_warning &&
         cycle_time == o.cycle_time;
}

void Bridge::publish() {
  sample_.block = supervisor_.block();
  sample_.motion_epoch = supervisor_.epoch();
  sample_.blocking_joint = static_cast<std::int8_t>(leash_.joint());
  mailboxes_.publishSample(sample_);

  Snapshot snapshot;
  snapshot.sample = sample_;
  snapshot.permission_since_ns = permission_since_ns_;
  snapshot.session = session_.counters();
  snapshot.counters = counters_;
  snapshot.supervisor = supervisor_.state();
  snapshot.hold_latched = supervisor_.held();
  snapshot.request_busy = configurator_.busy();
  snapshot.fall_backs = supervisor_.fallBacks();
  snapshot.loss = loss_;
  snapshot.state = connected_ ? static_cast<fri::FriState>(measurement_.state) : fri::FriState::Off;
  snapshot.quality =
      connected_ ? static_cast<fri::Quality>(measurement_.quality) : fri::Quality::Unacceptable;
  snapshot.control = static_cast<fri::ControlStrategy>(measurement_.control);
  snapshot.mode = wanted_mode_;
  snapshot.power = measurement_.power;
  snapshot.drive_error = measurement_.drive_error;
  snapshot.drive_warning = measurement_.drive_warning;
  snapshot.answer_rate = measurement_.answer_rate;
  snapshot.latency = measurement_.latency;
  snapshot.jitter = measurement_.jitter;
  snapshot.miss_rate = measurement_.miss_rate;
  snapshot.miss_counter = measurement_.miss_counter;
  snapshot.safety_scale = measurement_.safety_scale;
  snapshot.timestamp = measurement_.timestamp;
  std::copy(std::begin(measurement_.temperature), std::end(measurement_.temperature),
            snapshot.temperature.begin());
  snapshot.bounded_joints = bounded_joints_;
  snapshots_.write(snapshot);

  StateView view;
  view.supervisor = snapshot.supervisor;
  view.block = sample_.block;
  view.hold_latched = snapshot.hold_latched;
  view.blocking_joint = sample_.blocking_joint;
  view.motion_epoch = sample_.motion_epoch;
  view.loss = loss_;
  view.state = snapshot.state;
  view.quality = snapshot.quality;
  view.control = snapshot.control;
  view.power = snapshot.power;
  view.drive_error = snapshot.drive_error;
  view.drive_warning = snapshot.drive_warning;
  view.cycle_time = sample_.cycle_time;
  if (!(view == last_view_) && changes_.push(view)) last_view_ = view;
}

}  // namespace lwr_fri_bridge
