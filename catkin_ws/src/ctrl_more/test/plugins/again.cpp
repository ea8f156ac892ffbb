#include "plugin.hpp"

// Registers a name that good.cpp registers too.
class Again : public ctrl_more_test::Plugin {
 public:
  Again() : Plugin("Good") {}
};
CTRL_MORE_REGISTER_CONTROLLER(Again, "Good")
