/// @file
/// A ROS master for the whole of a gtest program, and this program as a node of it.
#pragma once

#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <string>

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <ros/init.h>
#include <ros/master.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

namespace coglab_rt {

constexpr double kMasterLimit = 60.0;  ///< s until it has to answer, on a busy machine, too

/// The master lives as long as this environment, and ends with this program however that ends.
class OwnMaster : public ::testing::Environment {
 public:
  /// @param node name of this program on ROS
  explicit OwnMaster(std::string node) : node_(std::move(node)) {}

  void SetUp() override {
    const std::string port = std::to_string(freePort());
    setenv("ROS_MASTER_URI", ("http://127.0.0.1:" + port).c_str(), 1);
    setenv("ROS_IP", "127.0.0.1", 1);
    master_ = fork();
    ASSERT_GE(master_, 0);
    if (master_ == 0) {
      prctl(PR_SET_PDEATHSIG, SIGTERM);
      const int nowhere = open("/dev/null", O_WRONLY);
      dup2(nowhere, STDOUT_FILENO);
      dup2(nowhere, STDERR_FILENO);
      execlp("rosmaster", "rosmaster", "--core", "-p", port.c_str(), nullptr);
      _exit(127);
    }
    ros::VP_string nothing;
    ros::init(nothing, node_, ros::init_options::NoSigintHandler);
    for (double waited = 0.0; !ros::master::check(); waited += 0.05) {
      ASSERT_LT(waited, kMasterLimit) << "no ROS master on port " << port;
      usleep(50'000);
    }
    ros::start();  // so that the node does not end with a test's last node handle
  }

  void TearDown() override {
    ros::shutdown();
    if (master_ <= 0) return;
    kill(master_, SIGTERM);
    waitpid(master_, nullptr, 0);
  }

 private:
  static std::uint16_t freePort() {
    const int probe = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    bind(probe, reinterpret_cast<sockaddr*>(&address), size);
    getsockname(probe, reinterpret_cast<sockaddr*>(&address), &size);
    close(probe);
    return ntohs(address.sin_port);
  }

  std::string node_;
  pid_t master_ = -1;
};

/// Body of `main` of such a program.
inline int runWithOwnMaster(int count, char** words, const char* node) {
  ::testing::InitGoogleTest(&count, words);
  ::testing::AddGlobalTestEnvironment(new OwnMaster(node));
  return RUN_ALL_TESTS();
}

}  // namespace coglab_rt
