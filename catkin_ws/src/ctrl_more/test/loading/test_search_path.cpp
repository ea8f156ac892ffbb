// Search places of files and libraries, and their order.
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "ctrl_more/loading/search_path.hpp"
#include "test_support.hpp"

namespace fs = std::filesystem;

namespace ctrl_more {
namespace {

// Temporary folders, and environment variables that are restored afterwards.
struct SearchPaths : ::testing::Test {
  fs::path root = fs::path(::testing::TempDir()) / "ctrl_more_search_path";
  std::vector<std::pair<std::string, std::string>> before;

  SearchPaths() {
    fs::remove_all(root);
    fs::create_directories(root);
    for (const char* name : {"CTRL_MORE_PATH", "CMAKE_PREFIX_PATH", "ROS_PACKAGE_PATH"}) {
      const char* value = std::getenv(name);
      if (value) before.emplace_back(name, value);
      unsetenv(name);
    }
  }
  ~SearchPaths() override {
    for (const char* name : {"CTRL_MORE_PATH", "CMAKE_PREFIX_PATH", "ROS_PACKAGE_PATH"}) {
      unsetenv(name);
    }
    for (const auto& each : before) setenv(each.first.c_str(), each.second.c_str(), 1);
    fs::remove_all(root);
  }
  void set(const char* variable, const std::string& value) { setenv(variable, value.c_str(), 1); }
  std::string make(const std::string& file) {
    const fs::path path = root / file;
    fs::create_directories(path.parent_path());
    std::ofstream(path.string()) << "x";
    return path.string();
  }
  static std::string refusal(const SearchPath& paths, const std::string& name) {
    try {
      return "found " + paths.find(name);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
  }
  /// The places that a refusal names.
  static std::string tried(const SearchPath& paths, const std::string& name) {
    const std::string said = refusal(paths, name);
    EXPECT_TRUE(contains(said, "'" + name + "'")) << said;
    const auto at = said.find("tried ");
    return at == std::string::npos ? said : said.substr(at + 6);
  }
};

TEST_F(SearchPaths, AbsolutePathsAreTakenAsTheyAre) {
  const std::string file = make("there.so");
  EXPECT_EQ(SearchPath("/base").find(file), file);
  EXPECT_EQ(tried(SearchPath("/base"), "/nowhere.so"), "/nowhere.so");
  EXPECT_TRUE(contains(refusal(SearchPath(root.string()), ""), "was not found")) << "a folder";
}

TEST_F(SearchPaths, TheFirstPlaceThatHasItWins) {
  const std::string base = make("base/it.so"), extra = make("base/more/it.so");
  const std::string mine = make("mine/it.so");
  set("CTRL_MORE_PATH", (root / "mine").string());
  const SearchPath paths((root / "base").string(), {"more"});
  EXPECT_EQ(paths.find("it.so"), base);
  fs::remove(base);
  EXPECT_EQ(paths.find("it.so"), extra);
  fs::remove(extra);
  EXPECT_EQ(paths.find("it.so"), mine);
}

TEST_F(SearchPaths, PackagesAreBelowTheirRootsOrTheRootsThemselves) {
  EXPECT_EQ(tried(SearchPath("/base"), "package://p/a/b.so").find("nothing"), 0u);
  set("ROS_PACKAGE_PATH", "/ws/src:/ws/src/p:/ws/src/pp");
  set("CMAKE_PREFIX_PATH", "/devel");
  EXPECT_EQ(tried(SearchPath("/base"), "package://p/a/b.so"),
            "/ws/src/p/a/b.so, /ws/src/p/p/a/b.so, /ws/src/p/a/b.so, /ws/src/pp/p/a/b.so, "
            "/devel/share/p/a/b.so");
  EXPECT_TRUE(contains(refusal(SearchPath("/base"), "package://p"), "tried /ws/src/p/,"));
}

TEST_F(SearchPaths, LibrariesOfATypeHaveFourNames) {
  const SearchPath paths(root.string());
  const auto found = [&](const std::string& type, const std::string& library) {
    const std::string file = make(library);
    const bool it = paths.findLibraryOf(type) == file;
    fs::remove(file);
    return it;
  };
  EXPECT_TRUE(found("WristDamper", "libWristDamper.so"));
  EXPECT_TRUE(found("WristDamper", "libfbkCtrlWristDamper.so"));
  EXPECT_TRUE(found("WristDamper", "libwrist_damper.so"));
  EXPECT_TRUE(found("WristDamper", "libctrl_more_wrist_damper.so"));
  EXPECT_TRUE(found("ZmpIP", "libzmp_ip.so")) << "a word begins after a small letter";
  EXPECT_TRUE(found("AttitudeMPCController", "libattitude_mpccontroller.so"));
  EXPECT_TRUE(found("A", "liba.so"));
  make("libwrist_damper.so");
  const std::string first = make("libWristDamper.so");
  EXPECT_EQ(paths.findLibraryOf("WristDamper"), first);
  try {
    paths.findLibraryOf("NotThere");
    ADD_FAILURE() << "it was found";
  } catch (const std::runtime_error& e) {
    EXPECT_TRUE(contains(e.what(),
                         "(libNotThere.so, libfbkCtrlNotThere.so, libnot_there.so, "
                         "libctrl_more_not_there.so)"))
        << e.what();
  }
}

TEST_F(SearchPaths, ShippedLibrariesLieBesideTheCore) {
  const std::string file = SearchPath("").find("libctrl_more_joint_limits.so");
  EXPECT_TRUE(fs::equivalent(file, CTRL_MORE_PLUGIN_DIR "/libctrl_more_joint_limits.so"));
  EXPECT_TRUE(fs::equivalent(SearchPath("").findLibraryOf("JointLimits"), file));
}

}  // namespace
}  // namespace ctrl_more
