#include <stdexcept>

#include "plugin.hpp"

// Cannot be initialized.
class Throwing : public ctrl_more_test::Plugin {
 public:
  Throwing() : Plugin("Throwing") {}
  void initialize(ctrl_more::Setup&) override { throw std::runtime_error("no such camera"); }
};
CTRL_MORE_REGISTER_CONTROLLER(Throwing, "Throwing")
