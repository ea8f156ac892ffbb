// Loads every library of a folder, one controller each: `ours` through a manager (declaration,
// configuration and plan included), `bare` through class_loader alone. Prints milliseconds.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <vector>

#include <class_loader/class_loader.hpp>

#include "ctrl_more/feedback_controllers_manager.hpp"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: ctrl_more_bench_loading ours|bare FOLDER\n");
    return 2;
  }
  std::vector<std::string> files;
  for (const auto& file : std::filesystem::directory_iterator(argv[2])) {
    files.push_back(file.path().string());
  }
  std::sort(files.begin(), files.end());
  std::size_t loaded = 0;
  const bool ours = std::strcmp(argv[1], "ours") == 0;
  ctrl_more::Logger logger;
  ctrl_more::RobotStates robot(&logger);
  ctrl_more::ControlStates control(0, 0.005, &logger);
  ctrl_more::FeedbackControllersManager manager(robot, control, {}, &logger);
  std::vector<std::unique_ptr<class_loader::ClassLoader>> loaders;
  std::vector<std::unique_ptr<ctrl_more::FeedbackController>> controllers;
  const auto begin = std::chrono::steady_clock::now();
  for (const std::string& file : files) {
    if (ours) {
      ctrl_more::ControllerEntry entry;
      entry.library = file;
      const ctrl_more::Status status = manager.loadController("c" + std::to_string(loaded), entry);
      if (!status) {
        std::fprintf(stderr, "%s\n", status.message().c_str());
        return 1;
      }
    } else {
      loaders.push_back(std::make_unique<class_loader::ClassLoader>(file));
      const auto classes = loaders.back()->getAvailableClasses<ctrl_more::FeedbackController>();
      if (classes.size() != 1) {
        std::fprintf(stderr, "%s lists %zu classes\n", file.c_str(), classes.size());
        return 1;
      }
      controllers.emplace_back(
          loaders.back()->createUnmanagedInstance<ctrl_more::FeedbackController>(classes[0]));
    }
    ++loaded;
  }
  const auto end = std::chrono::steady_clock::now();
  std::printf("%.4f\n", std::chrono::duration<double, std::milli>(end - begin).count());
  return loaded == files.size() ? 0 : 1;
}
