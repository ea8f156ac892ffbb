#include "plugin.hpp"

// Registers the same name as good.cpp.
class Again : public ctrl_more_test::Plugin {
 public:
  Again() : Plugin("Good") {}
};
CTRL_MORE_REGISTER_CONTROLLER(Again, "Good")
