#include "plugin.hpp"

class Good : public ctrl_more_test::Plugin {
 public:
  Good() : Plugin("Good") {}
};
CTRL_MORE_REGISTER_CONTROLLER(Good, "Good")
