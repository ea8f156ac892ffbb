#include "plugin.hpp"

// Registered under another name than it describes.
class WrongType : public ctrl_more_test::Plugin {
 public:
  WrongType() : Plugin("Described") {}
};
CTRL_MORE_REGISTER_CONTROLLER(WrongType, "Registered")
