// User code of the Ctrl-MORE paper, section VI-A: loads the attitude controller, writes IMU data,
// and reads the corrected pelvis orientation. It does not depend on the robot; see README.md.
#include <iostream>

#include <Eigen/Core>

#include "ctrl_more/central_module.hpp"

int main(int argc, char** argv) {
  using namespace ctrl_more;
  if (argc != 2) {
    std::cerr << "usage: ctrl_more_attitude_example CENTRAL_MODULE_FILE\n";
    return 2;
  }
  try {
    // Load controllers.
    CentralModule locomotor(argv[1]);
    for (const std::string& error : locomotor.loadErrors()) std::cerr << error << '\n';
    Status status = locomotor.feedbackControllers().enable("Attitude");
    if (!status) {
      std::cerr << status.message() << '\n';
      return 1;
    }

    // Encapsulate data in the robot states: roll, pitch, yaw; angular velocity; acceleration.
    RobotStates robot_state;
    ControlStates control_state;
    const Eigen::Vector3d ang_pos(0.1, -0.05, 0.0), ang_vel(0.0, 0.0, 0.0), lin_acc(0, 0, 9.81);
    Eigen::VectorXd imu_data(9);
    imu_data << ang_pos, ang_vel, lin_acc;
    robot_state.setMeasuredData("imu", imu_data, 0);

    // Apply the controllers.
    status = locomotor.update(robot_state, &control_state);
    if (!status) {
      std::cerr << status.message() << '\n';
      return 1;
    }
    const Eigen::Matrix3d pelvis = control_state.getPelvisOrientation();
    std::cout << pelvis << '\n';
    return 0;
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
}
