#include "plugin.hpp"

// Registered as the listing in section V-B of the Ctrl-MORE paper does it.
using namespace ctrl_more;

class ControlExample : public ctrl_more_test::Plugin {
 public:
  ControlExample() : Plugin("MyController") {
    addUsedControlState("com");
    addUsedRobotState("imu");
  }
};

extern "C" {
FeedbackController* feedbackExampleMaker() { return new ControlExample(); }
}

class dummyExample {
 public:
  dummyExample() { feedbackControllerPrototypes.insert({"MyController", feedbackExampleMaker}); }
};
dummyExample localDummyExample;
