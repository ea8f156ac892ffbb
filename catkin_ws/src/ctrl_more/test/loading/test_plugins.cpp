#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <iostream>
#include <map>
#include <thread>

#include "ctrl_more/feedback_controller.hpp"
#include "test_support.hpp"

namespace fs = std::filesystem;

namespace ctrl_more {
namespace {

const std::string kController = CTRL_MORE_PLUGIN_DIR;

std::string library(const std::string& name) { return kPlugins + "/lib" + name + ".so"; }

struct Plugins : ::testing::Test {
  Rig rig{0.0, false, false};
  LoadReport load(const std::string& yaml, bool strict = true) {
    return rig.manager->load(ConfigNode::fromText(yaml, "list.yaml"), kPlugins, strict);
  }
  void expectRefused(const std::string& yaml, const std::vector<std::string>& parts) {
    const LoadReport report = load(yaml);
    ASSERT_FALSE(report.ok()) << yaml;
    for (const std::string& part : parts) {
      EXPECT_TRUE(contains(report.text(), part)) << part << " not in: " << report.text();
    }
  }
};

TEST_F(Plugins, LoadsRunsAndUnloads) {
  ASSERT_TRUE(load("loadControllers: [Good]\nGood: {libPath: libgood.so, enabled: true}\n").ok());
  EXPECT_NE(prototypes().find("Good"), nullptr);
  rig.step();
  EXPECT_EQ(rig.control.getZMP()[0], 1.0);
  rig.manager->disable("Good");
  rig.step();
  ASSERT_TRUE(rig.manager->unload("Good"));
  rig.step(2);
  // The plan that still held the instance is freed with the next change.
  rig.manager->enable();
  EXPECT_EQ(prototypes().find("Good"), nullptr) << "the library is closed";
  ASSERT_TRUE(load("loadControllers: [Good]\nGood: {libPath: libgood.so}\n").ok()) << "again";
}

TEST_F(Plugins, PapersOwnMakerAndNames) {
  rig.robot.declare(RobotSource::Measured, "imu", 9, "rad, rad/s, m/s^2", "imu");
  ASSERT_TRUE(load("loadControllers: [MyController]\nMyController: {libPath: libpaper_maker.so, "
                   "enabled: true}\n")
                  .ok());
  const auto used = rig.manager->getUsedControlStates();
  EXPECT_EQ(used, (std::vector<std::string>{"centreOfMass/com", "zmp/zmp"}));
}

TEST_F(Plugins, PapersExampleFileIsRefusedWithLineAndSuggestion) {
  const std::string paper =
      "loadControllers: [Attitude , ZmpIP]\n"
      "Compliant:\n"
      "  libPath: /LIBPATH/locomotion/libfbkCtrlCompliant.so\n"
      "  configFile: /PROJECTPATH/configs/compliant.yaml\n"
      "ZmpIP:\n"
      "  libPath: /LIBPATH/locomotion/libfbkCtrlZmpIP.so\n"
      "  configFile: /PROJECTPATH/configs/zmpip.yaml\n"
      "AttitudeMPCController:\n"
      "  libPath: /LIBPATH/locomotion/libfbkCtrlAttitude.so\n"
      "  configFile: /PROJECTPATH/configs/Attitude.yaml\n";
  ASSERT_TRUE(load("loadControllers: [Good]\nGood: {libPath: libgood.so, enabled: true}\n").ok());
  const LoadReport report = load(paper);
  ASSERT_EQ(report.errors.size(), 2u);
  EXPECT_TRUE(contains(report.errors[0], "list.yaml:1:")) << report.errors[0];
  EXPECT_TRUE(contains(report.errors[0], "did you mean 'AttitudeMPCController'"));
  EXPECT_TRUE(contains(report.errors[1], "zmpip.yaml")) << report.errors[1];
  rig.step();
  EXPECT_EQ(rig.control.getZMP()[0], 1.0) << "what was loaded keeps running";
}

TEST_F(Plugins, BadLibrariesAreRefusedWithAReason) {
  expectRefused("loadControllers: [A]\nA: {libPath: libmissing.so}\n",
                {"list.yaml:2", "libPath", "libmissing.so", "tried"});
  expectRefused("loadControllers: [A]\nA: {libPath: libnone.so}\n", {"registers no controller"});
  expectRefused("loadControllers: [A]\nA: {libPath: libtwo.so}\n",
                {"more than one", "First, Second", "type"});
  expectRefused("loadControllers: [A]\nA: {libPath: libunresolved.so}\n", {"cannot be loaded"});
  expectRefused("loadControllers: [A]\nA: {libPath: libthrowing.so}\n", {"no such camera"});
  expectRefused("loadControllers: [A]\nA: {libPath: libwrong_type.so}\n",
                {"'Registered'", "'Described'"});
  expectRefused("loadControllers: [A]\nA: {libPath: libother_abi.so}\n",
                {"'OtherAbi'", "another ctrl_more",
                 "program has interface " + std::to_string(thisAbi().interface), "build it again"});
  expectRefused("loadControllers: [A]\nA: {libPath: libgood.so, type: God}\n",
                {"type 'God'", "did you mean 'Good'"});
  EXPECT_TRUE(prototypes().types().empty()) << "nothing stays behind";
  EXPECT_TRUE(load("loadControllers: [A]\nA: {libPath: libtwo.so, type: Second}\n").ok());
}

// An exception of a library has its code there and must be handled before the library is closed.
TEST_F(Plugins, AnyExceptionOfALibraryRefusesTheWholeList) {
  const std::string own = "an error of its own", strange = "not a std::exception";
  for (const auto& thrown :
       std::vector<std::pair<std::string, std::string>>{{"InMaker", own},
                                                        {"InDescribe", own},
                                                        {"InInitialize", own},
                                                        {"NumberInMaker", strange},
                                                        {"ThingInMaker", strange},
                                                        {"ThingInInitialize", strange}}) {
    for (const bool strict : {true, false}) {
      SCOPED_TRACE(thrown.first);
      const LoadReport report = load(
          "loadControllers: [first, odd]\nfirst: {libPath: libgood.so, enabled: true}\n"
          "odd: {libPath: libstrangers.so, type: " +
              thrown.first + "}\n",
          strict);
      ASSERT_EQ(report.errors.size(), 1u);
      EXPECT_TRUE(contains(report.errors[0], thrown.second)) << report.errors[0];
      EXPECT_TRUE(contains(report.errors[0], "odd")) << report.errors[0];
      EXPECT_EQ(rig.manager->getControllersNames().size(), strict ? 0u : 1u);
      EXPECT_EQ(rig.manager->getExecutionOrder().size(), strict ? 0u : 1u);
      EXPECT_EQ(prototypes().find(thrown.first), nullptr) << "its library is closed";
      rig.step(2);
      EXPECT_EQ(rig.control.getZMP()[0], strict ? 0.0 : 1.0);
      if (strict) continue;
      rig.manager->disable("first");
      rig.step(2);
      EXPECT_TRUE(rig.manager->unload("first"));
    }
  }
}

TEST_F(Plugins, AnExceptionOfALoadedLibraryIsAFaultOrARefusal) {
  ASSERT_TRUE(load("loadControllers: [update, judge]\n"
                   "update: {libPath: libstrangers.so, type: InUpdate, enabled: true}\n"
                   "judge: {libPath: libstrangers.so, type: InJudge}\n")
                  .ok());
  rig.step();
  EXPECT_TRUE(contains(rig.manager->status("update").fault_text, "an error of its own"));
  const Status status = rig.manager->setGains("judge", {{"k", {3.0}}});
  EXPECT_TRUE(contains(status.message(), "an error of its own")) << status.message();
  EXPECT_EQ(rig.manager->getGains("judge").all()["k"][0], 1.0);
}

TEST_F(Plugins, KnownTypeNameIsRefusedAndTheFirstOneStays) {
  ASSERT_TRUE(load("loadControllers: [Good]\nGood: {libPath: libgood.so, enabled: true}\n").ok());
  expectRefused("loadControllers: [B]\nB: {libPath: libagain.so}\n",
                {"registered already", "Good"});
  rig.step();
  EXPECT_EQ(rig.control.getZMP()[0], 1.0);
  EXPECT_NE(prototypes().find("Good"), nullptr);
}

TEST_F(Plugins, RefusedListIsNeverSeenByARunningCycle) {
  rig.step();  // frozen
  const LoadReport report = load(
      "loadControllers: [Good, Bad]\nGood: {libPath: libgood.so, enabled: true}\n"
      "Bad: {libPath: libnone.so}\nprofiles: {mine: [Good]}\n");
  EXPECT_EQ(report.errors.size(), 1u);
  EXPECT_TRUE(report.loaded.empty());
  EXPECT_EQ(prototypes().find("Good"), nullptr) << "its library is closed";
  EXPECT_FALSE(rig.manager->hasProfile("mine"));
  rig.step(2);
  EXPECT_EQ(rig.control.getZMP()[0], 0.0);
  ASSERT_TRUE(load("loadControllers: [Good]\nGood: {libPath: libgood.so, enabled: true}\n").ok());
  rig.step();
  EXPECT_EQ(rig.control.getZMP()[0], 1.0);
}

TEST_F(Plugins, WrongFilesAreRefusedWithTheirLine) {
  expectRefused("loadControllers: [Good]\nGood:\n  libPath: libgood.so\n  confgFile: x\n",
                {"list.yaml:4", "confgFile", "did you mean 'configFile'"});
  expectRefused("loadControllers: [Good]\nGood: {libPath: libgood.so, enabled: yess}\n",
                {"true or false"});
  expectRefused("loadControllers: [Good]\nGood: {libPath: libgood.so, on_fault: holdd}\n",
                {"did you mean 'hold'"});
  expectRefused("loadControllers: [Good]\nGood: {libPath: libgood.so, overrun_us: -1}\n",
                {"negative"});
  expectRefused("loadControllers: Good\n", {"list"});
  expectRefused("LoadControllers: [Good]\n", {"loadControllers"});
  expectRefused("[1, 2]\n", {"map"});
  expectRefused("loadControllers: []\nsharedSignals: maybe\n", {"sharedSignals"});
  expectRefused("loadControllers: []\nprofles: 3\n", {"did you mean 'profiles'"});
  expectRefused("loadControllers: []\nprofiles: {dmp: [nobody]}\n", {"nobody"});
  EXPECT_FALSE(rig.manager->load("/nowhere/list.yaml").ok());
}

TEST_F(Plugins, SharedSignalsCanBeRefused) {
  const std::string yaml =
      "loadControllers: [left, right]\nsharedSignals: refuse\n"
      "left: {libPath: libgood.so, enabled: true}\nright: {libPath: libgood.so, enabled: true}\n";
  expectRefused(yaml, {"both modify zmp/zmp", "sharedSignals is refuse"});
  EXPECT_FALSE(rig.manager->has("left"));
  EXPECT_FALSE(load(yaml, false).ok());
  EXPECT_TRUE(rig.manager->has("left"));
  EXPECT_FALSE(rig.manager->has("right"));
}

TEST_F(Plugins, LibrariesAreFoundWithoutAbsolutePaths) {
  const fs::path folder = fs::path(::testing::TempDir()) / "ctrl_more_search";
  fs::create_directories(folder / "share_root/my_pkg");
  fs::copy_file(library("good"), folder / "share_root/my_pkg/libgood_there.so",
                fs::copy_options::overwrite_existing);
  // package://
  setenv("ROS_PACKAGE_PATH", (folder / "share_root").c_str(), 1);
  EXPECT_TRUE(
      load("loadControllers: [a]\na: {libPath: 'package://my_pkg/libgood_there.so'}\n").ok());
  rig.manager->unload("a");
  // searchPath of the file, relative to it
  const LoadReport relative = rig.manager->load(
      ConfigNode::fromText("loadControllers: [a]\nsearchPath: [share_root/my_pkg]\n"
                           "a: {libPath: libgood_there.so}\n",
                           "x.yaml"),
      folder.string());
  EXPECT_TRUE(relative.ok()) << relative.text();
  rig.manager->unload("a");
  // environment
  setenv("CTRL_MORE_PATH", (folder / "share_root/my_pkg").c_str(), 1);
  EXPECT_TRUE(load("loadControllers: [a]\na: {libPath: libgood_there.so}\n").ok());
  unsetenv("CTRL_MORE_PATH");
  unsetenv("ROS_PACKAGE_PATH");
  // by type alone: the library is named after it
  setenv("CTRL_MORE_PATH", kController.c_str(), 1);
  const LoadReport by_type = load("loadControllers: [JointLimits]\nJointLimits: {}\n");
  EXPECT_TRUE(by_type.ok()) << by_type.text();
  unsetenv("CTRL_MORE_PATH");
  EXPECT_FALSE(load("loadControllers: [Nowhere]\nNowhere: {}\n").ok());
}

TEST_F(Plugins, ShippedListAndProfilesLoad) {
  setenv("CTRL_MORE_PATH", kController.c_str(), 1);
  const LoadReport report = rig.manager->load(CTRL_MORE_SOURCE_DIR "/config/feedback.yaml", true);
  unsetenv("CTRL_MORE_PATH");
  ASSERT_TRUE(report.ok()) << report.text();
  EXPECT_FALSE(rig.manager->isEnabled("ee_admittance")) << "ships loaded and disabled";
  EXPECT_FALSE(rig.manager->isEnabled("joint_limits")) << "the arm has a guard of its own";
  EXPECT_EQ(rig.manager->getProfiles(), (std::vector<std::string>{"dmp", "dmp_compliant", "ptp"}));
  rig.manager->applyProfile("dmp_compliant");
  EXPECT_TRUE(rig.manager->isEnabled("ee_admittance"));
  rig.manager->applyProfile("dmp");
  EXPECT_FALSE(rig.manager->isEnabled("ee_admittance"));
  EXPECT_TRUE(rig.manager->reloadGains("ee_admittance"));
}

// A folder with a library that is built twice.
struct TwoBuilds : Plugins {
  // One for each test: what stays in memory of another one is known by its path.
  fs::path folder = fs::path(::testing::TempDir()) / "ctrl_more_builds" /
                    ::testing::UnitTest::GetInstance()->current_test_info()->name();
  TwoBuilds() {
    fs::remove_all(folder);
    fs::create_directories(folder);
  }
  void build(const std::string& name) {
    // As a linker does it: another file of the same name.
    fs::copy_file(library(name), folder / "new");
    fs::rename(folder / "new", folder / "libit.so");
  }
  LoadReport loadIt(const std::string& controller = "it") {
    return rig.manager->load(
        ConfigNode::fromText("loadControllers: [" + controller + "]\n" + controller +
                                 ": {libPath: libit.so, enabled: true}\n",
                             "list.yaml"),
        folder.string());
  }
  double runOnce() {
    rig.step();
    return rig.control.getZMP()[0];
  }
  void unloadIt() {
    ASSERT_TRUE(rig.manager->disable("it"));
    rig.step(2);
    ASSERT_TRUE(rig.manager->unload("it"));
    rig.step(2);
  }
};

TEST_F(TwoBuilds, NewCodeRunsAfterUnloadingRebuildingAndLoading) {
  build("good");
  ASSERT_TRUE(loadIt().ok());
  EXPECT_EQ(runOnce(), 1.0);
  unloadIt();
  build("rebuilt");
  const LoadReport again = loadIt();
  ASSERT_TRUE(again.ok()) << again.text();
  EXPECT_EQ(runOnce(), 10.0);
}

TEST_F(TwoBuilds, OldCodeIsNeverLoadedUnderTheNameOfTheNew) {
  build("good");
  ASSERT_TRUE(loadIt().ok());
  build("rebuilt");
  const LoadReport second = loadIt("another");
  EXPECT_TRUE(contains(second.text(), "built again")) << second.text();
  EXPECT_TRUE(contains(second.text(), "unload")) << second.text();
  EXPECT_EQ(runOnce(), 1.0);
  unloadIt();
  EXPECT_TRUE(loadIt().ok());
  EXPECT_EQ(runOnce(), 10.0);
}

// Static objects of a library run only once, so the loader must store their registrations.
TEST_F(TwoBuilds, LibraryThatStaysInMemoryIsLoadedAgain) {
  build("resident");
  for (int i = 0; i < 3; ++i) {
    const LoadReport report = loadIt();
    ASSERT_TRUE(report.ok()) << report.text();
    EXPECT_EQ(runOnce(), 1.0);
    unloadIt();
  }
  rig.manager->enable();  // frees the plan that still held the instance
  EXPECT_EQ(prototypes().find("Good"), nullptr) << "not offered while it is not loaded";
  build("rebuilt");
  const LoadReport report = loadIt();
  EXPECT_TRUE(contains(report.text(), "old build")) << report.text();
  EXPECT_TRUE(contains(report.text(), "start the program"));
}

// In a separate process, because a fault of the loader would end or block the tests.
struct HarmfulLibraries : TwoBuilds {
  // Refused with all parts in the sentence, and another thread can load a good library afterwards.
  void refused(const std::vector<std::string>& parts) {
    const LoadReport report = load("loadControllers: [A]\nA: {libPath: libstatic_object.so}\n");
    for (const std::string& part : parts) {
      if (!contains(report.text(), part)) fail("not in '" + report.text() + "': " + part);
    }
    std::thread([this] {
      fail(load("loadControllers: [Good]\nGood: {libPath: libgood.so}\n").text());
    }).join();
  }
  static void fail(const std::string& why) {
    if (why.empty()) return;
    std::cerr << why << std::endl;
    _exit(1);
  }
  template <typename Function>
  static void within20s(Function function) {
    EXPECT_EXIT(
        {
          alarm(20);
          function();
          _exit(0);
        },
        ::testing::ExitedWithCode(0), "");
  }
};

TEST_F(HarmfulLibraries, AreRefusedAndBlockNoOtherThread) {
  const std::string opened = "it was opened", described = "'StaticObject' was made";
  for (const auto& [fault, parts] : std::map<std::string, std::vector<std::string>>{
           {"open_throw", {"no such camera"}},
           {"open_exit", {"ended the process", opened}},
           {"open_abort", {"crashed", "Aborted", opened}},
           {"open_crash", {"crashed", "Segmentation", opened}},
           {"open_hang", {"not return", opened}},
           {"describe_exit", {"ended the process", described}},
           {"describe_hang", {"not return", described}}}) {
    SCOPED_TRACE(fault);
    setenv("CTRL_MORE_TEST_FAULT", fault.c_str(), 1);
    within20s([this, parts = parts] { refused(parts); });
  }
  unsetenv("CTRL_MORE_TEST_FAULT");
}

TEST_F(HarmfulLibraries, AHangingInitializeBlocksNoQueryAndIsReportedToOtherChanges) {
  within20s([this] {
    ASSERT_TRUE(load("loadControllers: [Good]\nGood: {libPath: libgood.so}\n").ok());
    std::promise<void> hangs;
    auto controller = std::make_unique<TestController>();
    controller->on_initialize = [&](TestController&, ctrl_more::Setup&) {
      hangs.set_value();
      while (true) pause();
    };
    std::thread([&] { rig.manager->addController(std::move(controller), "odd"); }).detach();
    hangs.get_future().wait();
    if (rig.manager->statusAll().size() != 1 || rig.manager->has("odd")) fail("not as it was");
    if (rig.manager->enable("Good").cause() != Cause::Busy) fail("not busy");
  });
}

TEST_F(HarmfulLibraries, CutShortIsRefused) {
  const auto whole = fs::file_size(library("good"));
  for (const auto size : {std::uintmax_t{0}, std::uintmax_t{5000}, whole / 2, whole - 1}) {
    SCOPED_TRACE(size);
    within20s([&] {
      build("good");
      fs::resize_file(folder / "libit.so", size);
      if (loadIt().ok()) fail("loaded");
      build("good");
      fail(loadIt().text());
    });
  }
}

TEST_F(HarmfulLibraries, OverwrittenWhileLoadedKeepsRunningAndCanBeReloaded) {
  within20s([this] {
    build("good");
    fail(loadIt().text());
    fs::resize_file(folder / "libit.so", 0);
    if (runOnce() != 1.0) fail("not running");
    std::ofstream(folder / "libit.so") << std::ifstream(library("rebuilt")).rdbuf();
    if (runOnce() != 1.0) fail("not running");
    unloadIt();
    fail(loadIt().text());
    if (runOnce() != 10.0) fail("not the new one");
    const auto files = std::distance(fs::directory_iterator(folder), fs::directory_iterator());
    if (files != 1) fail("a copy stays behind");
  });
}

}  // namespace
}  // namespace ctrl_more
