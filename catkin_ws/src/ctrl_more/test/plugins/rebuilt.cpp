#include "plugin.hpp"

// A later build of Good.
class Rebuilt : public ctrl_more_test::Plugin {
 public:
  Rebuilt() : Plugin("Good") {}
  void update(const ctrl_more::Cycle& cycle, const ctrl_more::RobotStates& robot,
              const ctrl_more::ControlStates& original,
              ctrl_more::ModifiedControlStates& modified) override {
    for (int i = 0; i < 10; ++i) Plugin::update(cycle, robot, original, modified);
  }
};
CTRL_MORE_REGISTER_CONTROLLER(Rebuilt, "Good")
