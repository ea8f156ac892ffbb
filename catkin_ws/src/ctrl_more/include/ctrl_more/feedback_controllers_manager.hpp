#pragma once

/// @file
/// For a program that runs controllers: the manager, the states, the loader, the documentation.

#include "ctrl_more/docs/documentation.hpp"
#include "ctrl_more/loading/controller_instance.hpp"
#include "ctrl_more/loading/search_path.hpp"
#include "ctrl_more/log/logger.hpp"
#include "ctrl_more/manager/feedback_controllers_manager.hpp"
#include "ctrl_more/states/signal_mailbox.hpp"
#include "ctrl_more/states/so3.hpp"
