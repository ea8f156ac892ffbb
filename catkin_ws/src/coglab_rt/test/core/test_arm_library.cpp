/// An arm from a library: made and run, or refused with a reason.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>

#include "coglab_rt/arm_library.hpp"

namespace {

std::string library(const std::string& name) { return ARM_LIBRARIES + name + ".so"; }

std::string refusal(const std::string& file) {
  try {
    coglab_rt::loadArm(file);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(ArmLibrary, AnArmOfALibraryMeasures) {
  const auto arm = coglab_rt::loadArm(library("shortest"));
  std::atomic<int> woken{0};
  arm->start([&woken](bool) { ++woken; });
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (woken < 3 && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  arm->shutdown();
  coglab_rt::RobotSample sample;
  EXPECT_TRUE(arm->mailboxes().newestSample(sample));
  EXPECT_GE(sample.sequence, 3U);
}

TEST(ArmLibrary, UnusableLibrariesAreRefusedWithAReason) {
  for (const auto& [file, words] :
       {std::pair<std::string, std::string>{library("none"), "COGLAB_ARM"},
        {library("other_version"), "interface 999"},
        {library("throwing"), "no cable is plugged in"},
        {"/nowhere/libmy_arm.so", "cannot be opened: /nowhere/libmy_arm.so"},
        {__FILE__, "cannot be opened"}}) {
    const std::string said = refusal(file);
    EXPECT_NE(said.find("the arm's library " + file + ": "), std::string::npos) << said;
    EXPECT_NE(said.find(words), std::string::npos) << said;
  }
}

// To open such a file can end the process: the linker maps more than there is.
TEST(ArmLibrary, AFileThatIsCutShortIsRefusedByPathAndByName) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path(testing::TempDir()) / "coglab_cut_arm";
  fs::create_directories(folder);
  const fs::path file = folder / "libcoglab_cut_arm.so";
  fs::copy_file(library("shortest"), file, fs::copy_options::overwrite_existing);
  fs::resize_file(file, fs::file_size(file) / 8);
  setenv("LD_LIBRARY_PATH", folder.c_str(), 1);
  for (const std::string& name : {file.string(), file.filename().string()})
    EXPECT_NE(refusal(name).find("cut short"), std::string::npos) << refusal(name);
  fs::remove_all(folder);
}

}  // namespace
