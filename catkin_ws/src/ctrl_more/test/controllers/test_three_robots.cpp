// One unchanged attitude library on three robots with three configuration files: the paper's claim
// (section VI-A) in closed loop, to 1e-12 after the change of frame.
#include <fstream>
#include <iterator>

#include "controller_rig.hpp"

namespace ctrl_more {
namespace {

struct Robot {
  std::string name;
  std::string configuration;
  Eigen::Quaterniond mount;  // body to IMU
  Eigen::Quaterniond world;  // this robot's world in the common one
};

// The same body motion for all: first-order lag toward the commanded orientation, pushed.
class Body {
 public:
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();  // world
  void step(const Eigen::Quaterniond& command, int k, double dt) {
    const Eigen::Vector3d push(0.3 * std::sin(0.05 * k), 0.2 * std::cos(0.03 * k), 0.1);
    rate = 8.0 * logOf(command * orientation.conjugate()) + push;
    orientation = (expOf(dt * rate) * orientation).normalized();
  }
};

const std::string kLibrary = std::string(CTRL_MORE_PLUGIN_DIR) + "/libctrl_more_attitude.so";

std::string bytesOfLibrary() {
  std::ifstream stream(kLibrary, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// Measurement of a robot's IMU, in its own world and with its own mount.
Eigen::VectorXd sensorData(const Robot& robot, const Body& body, std::string& key) {
  const Eigen::Quaterniond imu = robot.world.conjugate() * body.orientation * robot.mount;
  const Eigen::Vector3d gyro = (body.orientation * robot.mount).conjugate() * body.rate;
  const Eigen::Matrix3d r = imu.toRotationMatrix();
  if (contains(robot.configuration, "rpy_gyro_acc")) {
    key = "wrist_imu";
    Eigen::VectorXd data(9);
    data << std::atan2(r(2, 1), r(2, 2)), std::asin(-r(2, 0)), std::atan2(r(1, 0), r(0, 0)), gyro,
        0, 0, 9.81;
    return data;
  }
  Eigen::VectorXd data(10);
  if (contains(robot.configuration, "wxyz")) {
    key = "torso_imu";
    data << imu.w(), imu.x(), imu.y(), imu.z(), 0, 0, 9.81, gyro;
  } else {
    key = "imu";
    data << imu.coeffs(), 0, 0, 9.81, gyro;
  }
  return data;
}

std::vector<Robot> threeRobots() {
  const std::string gains =
      "kp: [0.6, 0.4, 0.2]\nki: [1, 2, 0.5]\nkd: [0.02, 0.03, 0.01]\nmax_angle: 0.5\n";
  const Eigen::Quaterniond tilted = expOf({0.4, -1.1, 2.0});
  std::string mount = "mount: [";
  for (int i = 0; i < 4; ++i) {
    char number[32];
    std::snprintf(number, sizeof number, "%s%.17g", i ? ", " : "", tilted.coeffs()[i]);
    mount += number;
  }
  mount += "]\n";
  return {{"LWR with wrist IMU",
           gains + "imu: wrist_imu\nimu_layout: rpy_gyro_acc\ntarget: pose\npose: wrist\n",
           Eigen::Quaterniond::Identity(), Eigen::Quaterniond::Identity()},
          {"biped torso, quaternion in another order",
           gains + "imu: torso_imu\nimu_layout: quaternion_wxyz_acc_gyro\ntarget: pelvis\n",
           Eigen::Quaterniond::Identity(), expOf({0, 0, 1.3})},
          {"IMU mounted turned",
           gains + mount + "imu_layout: quaternion_acc_gyro\ntarget: pose\npose: chest\n", tilted,
           expOf({0.2, 0.5, -0.7})}};
}

// Trajectory of a body whose orientation the library corrects on this robot.
void follow(const Robot& robot, std::vector<Eigen::Quaterniond>& path) {
  ControllerRig rig;
  rig.control.declare(ControlContainer::TaskSpaceReferencePose, "wrist", 7);
  rig.control.declare(ControlContainer::TaskSpaceReferencePose, "chest", 7);
  const Status status = rig.load("attitude", robot.configuration);
  ASSERT_TRUE(status) << robot.name << ": " << status.message();
  const bool pelvis = contains(robot.configuration, "target: pelvis");
  const std::string pose_key = contains(robot.configuration, "wrist_imu") ? "wrist" : "chest";
  const Eigen::Quaterniond to_common = robot.world;
  Body body;
  for (int k = 0; k < 1000; ++k) {
    std::string key;
    const Eigen::VectorXd data = sensorData(robot, body, key);
    ASSERT_TRUE(rig.robot.setMeasuredData(key, data, rig.cycle.now_ns));
    // The common reference, in this robot's world.
    const Eigen::Quaterniond reference =
        (to_common.conjugate() * expOf({0.1 * std::sin(0.02 * k), 0.05, 0})).normalized();
    Eigen::VectorXd pose(7);
    pose << 0.1, 0.2, 0.3, reference.coeffs();
    if (pelvis) {
      rig.control.setPelvisOrientation(reference.toRotationMatrix());
    } else {
      ASSERT_TRUE(rig.control.setTaskSpaceReferencePose(pose_key, pose));
    }
    rig.cycleOnce();
    Eigen::Quaterniond command(rig.control.getPelvisOrientation());
    if (!pelvis) {
      rig.control.getTaskSpaceReferencePose(pose_key, pose);
      command = Eigen::Quaterniond(pose.tail<4>().data());
    }
    body.step(to_common * command, k, 0.005);
    path.push_back(body.orientation);
  }
  EXPECT_EQ(rig.manager->status("c").faults, 0u);
}

TEST(ThreeRobots, OneLibraryThreeFilesOneResult) {
  const std::string library_before = bytesOfLibrary();
  ASSERT_FALSE(library_before.empty());

  std::vector<std::vector<Eigen::Quaterniond>> paths;
  for (const Robot& robot : threeRobots()) {
    std::vector<Eigen::Quaterniond> path;
    ASSERT_NO_FATAL_FAILURE(follow(robot, path));
    paths.push_back(path);
  }
  EXPECT_EQ(bytesOfLibrary(), library_before) << "the same file for all of them";
  double largest = 0.0, moved = 0.0;
  for (std::size_t k = 0; k < paths[0].size(); ++k) {
    for (std::size_t r = 1; r < paths.size(); ++r) {
      largest = std::max(largest, logOf(paths[r][k] * paths[0][k].conjugate()).norm());
    }
    moved = std::max(moved, logOf(paths[0][k]).norm());
  }
  EXPECT_LT(largest, 1e-12);
  EXPECT_GT(moved, 0.05) << "something happened";
}

}  // namespace
}  // namespace ctrl_more
