#include "coglab_controllers/ros/tf_goal_source.hpp"

#include <exception>

#include <geometry_msgs/TransformStamped.h>

namespace coglab_controllers {

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
