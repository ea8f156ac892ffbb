#pragma once

/// @file
/// For a program with several managers: the central module, and what a manager of its own
/// implements.

#include "ctrl_more/feedback_controllers_manager.hpp"
#include "ctrl_more/manager/central_module.hpp"
