#pragma once

/// @file
/// For the author of a controller: the base class, its registration, the log, rotations.

#include "ctrl_more/loading/prototypes.hpp"
#include "ctrl_more/log/logger.hpp"
#include "ctrl_more/states/so3.hpp"
