// ROS side of the point-to-point plug-in: D4.10 Table 5, and the registration of both halves.
#include <ros/ros.h>

#include "coglab_controllers/manager/plugin_registry.hpp"
#include "coglab_controllers/plugins/ptp_controller.hpp"
#include "coglab_controllers/ros/motion_controller_ros.hpp"
#include "coglab_controllers/ros/path_topic.hpp"
#include "coglab_msgs/AddPtp.h"
#include "coglab_msgs/FinishedPtp.h"
#include "coglab_msgs/UnfinishedPtp.h"

namespace coglab_controllers {

class PtpControllerRos : public MotionControllerRos {
 public:
  ~PtpControllerRos() override { service_.shutdown(); }

  void attach(MotionController& controller, const ros::NodeHandle& node,
              const RosContext&) override {
    controller_ = &dynamic_cast<PtpController&>(controller);
    node_ = node;
    // Latched: a short motion may end before the subscribers of a new controller are connected.
    finished_ = node_.advertise<coglab_msgs::FinishedPtp>("finished_ptp", 50, true);
    unfinished_ = node_.advertise<coglab_msgs::UnfinishedPtp>("unfinished_ptp", 100);
    path_.attach(node_, controller_->baseFrame());
    service_ = node_.advertiseService("add_ptp", &PtpControllerRos::onAdd, this);
  }

  void spinOnce() override {
    EndedMotion end;
    while (controller_->readEnd(end)) {
      if (end.executed) {
        coglab_msgs::FinishedPtp message;
        message.ptp_id = end.id;
        finished_.publish(message);
      } else {
        coglab_msgs::UnfinishedPtp message;
        message.ptp_id = end.id;
        message.reason_code = end.reason.number();
        message.reason = end.reason.str();
        unfinished_.publish(message);
        ROS_LOG(endLevel(end.reason), ROSCONSOLE_DEFAULT_NAME, "ptp_id %d was not executed: %s",
                end.id, end.reason.c_str());
      }
    }
    path_.spin(*controller_, controller_->moving());
  }

 private:
  bool onAdd(coglab_msgs::AddPtp::Request& request, coglab_msgs::AddPtp::Response& response) {
    const MotionAnswer answer =
        controller_->add({request.position, request.max_vel, request.max_acc});
    response.status = answer.status;
    response.ptp_id = answer.id;
    response.success = answer.success;
    response.reason_code = answer.number();
    response.message = answer.message;
    if (!response.success) ROS_WARN("add_ptp rejected: %s", answer.message.c_str());
    return true;
  }

  PtpController* controller_ = nullptr;
  ros::NodeHandle node_;
  ros::Publisher finished_, unfinished_;
  ros::ServiceServer service_;
  PathTopic path_;
};

}  // namespace coglab_controllers

COGLAB_REGISTER_MOTION_CONTROLLER_WITH_ROS("coglab/PtpController",
                                           coglab_controllers::PtpController,
                                           coglab_controllers::PtpControllerRos)
