#include "coglab_controllers/ros/tf_listener.hpp"

#include <cmath>
#include <exception>

#include "coglab_rt/ros/ros_time.hpp"

namespace coglab_controllers {

namespace {

constexpr std::size_t kNamesKept =
    256;  // of refused frames; bounded, because any node can send names

bool isFinite(const geometry_msgs::Transform& transform) {
  const auto& t = transform.translation;
  const auto& q = transform.rotation;
  for (const double value : {t.x, t.y, t.z, q.x, q.y, q.z, q.w}) {
    if (!std::isfinite(value)) return false;
  }
  return true;
}

/// Removes a leading slash: tf2 treats both forms as the same name.
std::string bare(const std::string& frame) {
  return !frame.empty() && frame[0] == '/' ? frame.substr(1) : frame;
}

}  // namespace

void TfListener::start() {
  ros::NodeHandle node;
  node.setCallbackQueue(&queue_);
  dynamic_ = node.subscribe<tf2_msgs::TFMessage>(
      "/tf", 100, boost::function<void(const Event&)>([this](const Event& event) {
        receive(*event.getConstMessage(), event.getPublisherName(), false);
      }));
  static_ = node.subscribe<tf2_msgs::TFMessage>(
      "/tf_static", 100, boost::function<void(const Event&)>([this](const Event& event) {
        receive(*event.getConstMessage(), event.getPublisherName(), true);
      }));
  spinner_ = std::make_unique<ros::AsyncSpinner>(1, &queue_);
  spinner_->start();
}

void TfListener::stop() {
  if (spinner_) spinner_->stop();
  spinner_.reset();
  dynamic_.shutdown();
  static_.shutdown();
}

void TfListener::receive(const tf2_msgs::TFMessage& message, const std::string& publisher,
                         bool is_static) {
  clearAfterAStepBack();
  for (const geometry_msgs::TransformStamped& transform : message.transforms) {
    if (!acceptable(transform, publisher, is_static)) {
      refused_.fetch_add(1, std::memory_order_relaxed);
      continue;
    }
    try {
      if (is_static) {
        putStatic(transform, publisher);
      } else {
        buffer_.setTransform(transform, publisher, false);
      }
    } catch (const std::exception& error) {
      refused_.fetch_add(1, std::memory_order_relaxed);
      ROS_WARN_THROTTLE(5.0, "tf of %s refused: %s", publisher.c_str(), error.what());
    }
  }
}

void TfListener::putStatic(const geometry_msgs::TransformStamped& transform,
                           const std::string& publisher) {
  // A moving frame has a history by stamps. A static transform with a stamp would join it, and a
  // stamp from the future would block all later ones. Without a stamp the transform is too old for
  // a history, and still valid for a static frame.
  geometry_msgs::TransformStamped unstamped = transform;
  unstamped.header.stamp = ros::Time();
  if (buffer_.setTransform(unstamped, publisher, true)) return;
  refused_.fetch_add(1, std::memory_order_relaxed);
  ROS_WARN_THROTTLE(5.0,
                    "static tf of '%.100s' from %s refused: expected a frame that does not move, "
                    "or names and a rotation that are valid",
                    transform.child_frame_id.c_str(), publisher.c_str());
}

bool TfListener::acceptable(const geometry_msgs::TransformStamped& transform,
                            const std::string& publisher, bool is_static) {
  const std::string& frame = transform.child_frame_id;
  if (!isFinite(transform.transform)) {
    ROS_WARN_THROTTLE(5.0, "tf of '%.100s' from %s refused: it holds a number that is not finite",
                      frame.c_str(), publisher.c_str());
    return false;
  }
  if (is_static) return true;  // valid at any time; its stamp does not matter
  const std::int64_t ahead =
      coglab_rt::nanoseconds(transform.header.stamp) - coglab_rt::nanoseconds(ros::Time::now());
  const bool future = ahead > kClockTolerance_ns;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!future) {
      ahead_.erase(bare(frame));
    } else if (ahead_.size() < kNamesKept || ahead_.count(bare(frame)) != 0) {
      ahead_[bare(frame)] = 1e-9 * static_cast<double>(ahead);
    }
  }
  if (future) {
    ROS_WARN_THROTTLE(5.0,
                      "tf of '%.100s' from %s refused: stamped %.3f s ahead of this computer's "
                      "clock (allowed: %.3f s); synchronise the clocks. %llu refused so far",
                      frame.c_str(), publisher.c_str(), 1e-9 * static_cast<double>(ahead),
                      1e-9 * static_cast<double>(kClockTolerance_ns),
                      static_cast<unsigned long long>(refused() + 1));
  }
  return !future;
}

double TfListener::ahead(const std::string& frame) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = ahead_.find(bare(frame));
  return found == ahead_.end() ? 0.0 : found->second;
}

void TfListener::clearAfterAStepBack() {
  // Everything in the buffer is from the future now.
  const std::int64_t now = coglab_rt::nanoseconds(ros::Time::now());
  const std::lock_guard<std::mutex> lock(mutex_);
  if (now < last_now_ns_ - kClockTolerance_ns) {
    ROS_WARN("this computer's clock went back by %.3f s: transforms are forgotten",
             1e-9 * static_cast<double>(last_now_ns_ - now));
    buffer_.clear();
    clock_steps_.fetch_add(1, std::memory_order_relaxed);
  }
  last_now_ns_ = now;
}

bool TfGoalSource::lookup(const std::string& reference, const std::string& frame,
                          GoalObservation& observation, std::string& why) {
  const std::uint32_t steps = listener_.clockSteps();  // before the buffer is read
  geometry_msgs::TransformStamped transform;
  try {
    transform = buffer_.lookupTransform(reference, frame, ros::Time(0));
  } catch (const std::exception& error) {  // tf2 throws more than its own exceptions
    why = error.what();
    return false;
  }
  const auto& t = transform.transform.translation;
  const auto& q = transform.transform.rotation;
  observation.position = Vector3(t.x, t.y, t.z);
  observation.orientation = Quaternion(q.w, q.x, q.y, q.z);
  observation.clock_steps = steps;
  observation.frame_ns = coglab_rt::nanoseconds(transform.header.stamp);
  observation.stamp_ns = observation.frame_ns == 0
                             ? steady_()
                             : coglab_rt::toSteady(transform.header.stamp, steady_());
  return true;
}

}  // namespace coglab_controllers
