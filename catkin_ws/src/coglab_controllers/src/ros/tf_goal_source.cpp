#include "coglab_controllers/ros/tf_goal_source.hpp"

#include <geometry_msgs/TransformStamped.h>
#include <tf2/exceptions.h>

#include "coglab_controllers/ros/motion_controller_ros.hpp"

namespace coglab_controllers {

bool TfGoalSource::lookup(const std::string& reference, const std::string& frame,
                          GoalObservation& observation, std::string& why) {
  geometry_msgs::TransformStamped transform;
  try {
    transform = buffer_.lookupTransform(reference, frame, ros::Time(0));
  } catch (const tf2::TransformException& error) {
    why = error.what();
    return false;
  }
  const auto& t = transform.transform.translation;
  const auto& q = transform.transform.rotation;
  observation.position = Vector3(t.x, t.y, t.z);
  observation.orientation = Quaternion(q.w, q.x, q.y, q.z);
  // Static transforms have no stamp: they are as good as captured now.
  observation.stamp_ns =
      transform.header.stamp.isZero() ? steadyNow() : toSteady(transform.header.stamp);
  return true;
}

}  // namespace coglab_controllers
