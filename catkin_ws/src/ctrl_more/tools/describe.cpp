// Writes the documentation page or the configuration template of a controller library, or checks
// whether a list file can be loaded.
#include <cstring>
#include <iostream>

#include "ctrl_more/feedback_controllers_manager.hpp"
#include "ctrl_more/loading/controller_instance.hpp"

namespace {

// Loads a list file with empty stores. Prints one line for each error.
int list(const char* file) {
  ctrl_more::Logger quiet;
  ctrl_more::RobotStates robot(&quiet);
  ctrl_more::ControlStates control(0, 0.005, &quiet);
  ctrl_more::FeedbackControllersManager manager(robot, control, {}, &quiet);
  const ctrl_more::LoadReport report = manager.load(file);
  for (const std::string& error : report.errors) std::cerr << error << '\n';
  if (!report.ok()) return 1;
  manager.plotAll(std::cout);
  return 0;
}

int describe(const char* what, const char* library) {
  const ctrl_more::ControllerInstance instance = ctrl_more::makeController(library, "");
  const ctrl_more::Description description = instance.controller->describe();
  std::vector<std::string> faults = description.faults();
  if (std::strcmp(what, "check") == 0) {
    const auto empty = description.emptyFields();
    faults.insert(faults.end(), empty.begin(), empty.end());
  }
  for (const std::string& fault : faults) std::cerr << fault << '\n';
  if (!faults.empty()) return 1;
  if (std::strcmp(what, "page") == 0) std::cout << ctrl_more::documentationPage(description);
  if (std::strcmp(what, "config") == 0) std::cout << ctrl_more::configurationTemplate(description);
  return 0;
}

bool known(const char* what) {
  for (const char* command : {"page", "config", "check", "list"}) {
    if (std::strcmp(what, command) == 0) return true;
  }
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3 || !known(argv[1])) {
    std::cerr << "usage: ctrl_more_describe page|config|check LIBRARY\n"
                 "       ctrl_more_describe list FILE\n"
                 "  page    documentation page in Markdown\n"
                 "  config  configuration file with all gains and settings at initial values\n"
                 "  check   exit status 1, and one line each, for fields left empty\n"
                 "  list    loads a list file and shows each controller of it\n";
    return 2;
  }
  try {
    return std::strcmp(argv[1], "list") == 0 ? list(argv[2]) : describe(argv[1], argv[2]);
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
}
