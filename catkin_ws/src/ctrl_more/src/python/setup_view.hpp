#pragma once

#include "bindings.hpp"

namespace ctrl_more::python {

/// `setup` of initialize(), which ends with it.
struct SetupView {
  Setup* now = nullptr;  ///< null outside initialize()

  Setup& setup() const {
    if (!now) refuse("setup can be used in initialize() alone; keep the handles that it gives");
    return *now;
  }
};

}  // namespace ctrl_more::python
