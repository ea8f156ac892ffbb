// A plug-in with an exception class of its own, for the address sanitizer: built and run by
// test_sanitizers.py. Arguments: the plug-in's library, folder of lwr_description.
#include <cstdio>
#include <fstream>
#include <sstream>

#include "coglab_controllers/manager/controller_manager.hpp"
#include "coglab_rt/joint_limits_table.hpp"

int main(int argc, char** argv) {
  using namespace coglab_controllers;
  if (argc != 3) {
    std::fprintf(stderr, "usage: plugin_exceptions LIBRARY DESCRIPTION_FOLDER\n");
    return 2;
  }
  const std::string description = argv[2];
  std::ifstream file(description + "/urdf/lwr_ih2.urdf");
  std::ostringstream urdf;
  urdf << file.rdbuf();
  const auto table = coglab_rt::loadJointLimits(description + "/config/joint_limits.yaml");
  ManagerSettings settings = readManagerSettings(YAML::Node(), urdf.str(), table, true);
  settings.types["test/Throwing"] = argv[1];
  ctrl_more::Logger logger;
  settings.logger = &logger;
  ControllerManager manager(std::move(settings));
  for (int round = 0; round < 20; ++round) {
    const Answer answer = manager.load("odd", "test/Throwing");
    if (answer.success || answer.message.find("an error of its own") == std::string::npos) {
      std::fprintf(stderr, "unexpected answer: %s\n", answer.message.c_str());
      return 1;
    }
  }
  return 0;
}
