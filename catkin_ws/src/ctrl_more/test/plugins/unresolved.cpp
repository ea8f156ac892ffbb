#include "plugin.hpp"

// Needs a function that does not exist.
void missingFunction();
class Unresolved : public ctrl_more_test::Plugin {
 public:
  Unresolved() : Plugin("Unresolved") {}
};
CTRL_MORE_REGISTER_CONTROLLER(Unresolved, "Unresolved")
namespace {
const bool called_while_loading = (missingFunction(), true);
}
extern "C" bool unresolvedWasCalled() { return called_while_loading; }
void (*const address_of_missing)() = &missingFunction;
