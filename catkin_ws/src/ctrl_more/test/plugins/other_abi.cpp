#include "plugin.hpp"

// Reports other headers than the program's.
namespace {

class OtherAbi : public ctrl_more_test::Plugin {
 public:
  OtherAbi() : Plugin("OtherAbi") {}
};

ctrl_more::FeedbackController* make() { return new OtherAbi(); }

ctrl_more::Abi other() {
  ctrl_more::Abi abi = ctrl_more::thisAbi();
  ++abi.interface;
  return abi;
}

const ctrl_more::PrototypeRegistration registration("OtherAbi", &make, other());

}  // namespace
