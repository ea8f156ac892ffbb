#include <fstream>
#include <sstream>

#include "ctrl_more/feedback_controller.hpp"
#include "test_support.hpp"

namespace ctrl_more {
namespace {

std::string contentOf(const std::string& path) {
  std::ifstream stream(path);
  std::stringstream text;
  text << stream.rdbuf();
  return text.str();
}

// Where the page and the configuration of a controller are.
std::string pathOf(const std::string& folder, const std::string& file) {
  const std::string root = CTRL_MORE_SOURCE_DIR;
  const std::string shipped = root + "/" + folder + "/" + file;
  return std::ifstream(shipped) ? shipped : root + "/examples/humanoid/" + file;
}

class Documentation : public ::testing::TestWithParam<const char*> {
 protected:
  Description description() const {
    const std::string file =
        std::string(CTRL_MORE_PLUGIN_DIR) + "/libctrl_more_" + GetParam() + ".so";
    return makeController(file, "").controller->describe();
  }
};

TEST_P(Documentation, NoFieldIsEmpty) {
  const auto empty = description().emptyFields();
  EXPECT_TRUE(empty.empty()) << empty.front();
  const auto faults = description().faults();
  EXPECT_TRUE(faults.empty()) << faults.front();
}

TEST_P(Documentation, ShippedConfigurationHasEveryKeyAtItsInitialValue) {
  EXPECT_EQ(contentOf(pathOf("config", std::string(GetParam()) + ".yaml")),
            configurationTemplate(description()));
}

TEST_P(Documentation, PageShowsEverySignalAndGain) {
  const Description d = description();
  const std::string page = documentationPage(d);
  for (const GainSpec& s : d.gains) EXPECT_TRUE(contains(page, "`" + s.name + "`"));
  for (const SettingSpec& s : d.settings) EXPECT_TRUE(contains(page, "`" + s.name + "`"));
  for (const RobotSignalUse& s : d.robot_signals) EXPECT_TRUE(contains(page, s.text));
  for (const ControlSignalUse& s : d.control_signals) EXPECT_TRUE(contains(page, s.text));
}

INSTANTIATE_TEST_SUITE_P(Shipped, Documentation,
                         ::testing::Values("attitude", "compliant_stabiliser", "zmp_dcm",
                                           "ee_admittance", "joint_limits"));

}  // namespace
}  // namespace ctrl_more
