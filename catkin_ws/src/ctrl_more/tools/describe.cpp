// Writes the documentation page or the configuration template of a controller library.
#include <cstring>
#include <iostream>

#include "ctrl_more/documentation.hpp"
#include "ctrl_more/plugin_library.hpp"

int main(int argc, char** argv) {
  const bool page = argc == 3 && std::strcmp(argv[1], "page") == 0;
  const bool config = argc == 3 && std::strcmp(argv[1], "config") == 0;
  const bool check = argc == 3 && std::strcmp(argv[1], "check") == 0;
  if (!page && !config && !check) {
    std::cerr << "usage: ctrl_more_describe page|config|check LIBRARY\n"
                 "  page    documentation page in Markdown\n"
                 "  config  configuration file with all gains and settings at initial values\n"
                 "  check   exit status 1, and one line each, for fields left empty\n";
    return 2;
  }
  try {
    const ctrl_more::ControllerInstance instance = ctrl_more::makeController(argv[2], "");
    const ctrl_more::Description description = instance.controller->describe();
    std::vector<std::string> faults = description.faults();
    if (check) {
      const auto empty = description.emptyFields();
      faults.insert(faults.end(), empty.begin(), empty.end());
    }
    for (const std::string& fault : faults) std::cerr << fault << '\n';
    if (!faults.empty()) return 1;
    if (page) std::cout << ctrl_more::documentationPage(description);
    if (config) std::cout << ctrl_more::configurationTemplate(description);
    return 0;
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
}
