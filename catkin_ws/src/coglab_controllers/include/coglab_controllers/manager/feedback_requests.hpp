/// @file
/// Checks of requests to the feedback controllers, before they reach Ctrl-MORE. The request is
/// documented in coglab_msgs/FeedbackSelect.srv.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "ctrl_more/manager/controller_status.hpp"
#include "ctrl_more/states/status.hpp"

namespace coglab_controllers {

/// Largest length of a request's reason, bytes of UTF-8.
inline constexpr std::size_t kLongestReason = 200;

/// Refuses a reason that cannot be displayed. It must be UTF-8 of at most kLongestReason bytes,
/// without control characters, line breaks or marks of writing direction, and not only spaces. ""
/// is allowed.
ctrl_more::Status judgeReason(const std::string& reason);

/// Refuses an empty name in the list of controllers. An empty list means all controllers.
ctrl_more::Status judgeNames(const std::vector<std::string>& names);

/// Refuses to withdraw a reason that pauses no controller. Each named controller must be paused for
/// it, or at least one if no name is given. "user" may be withdrawn at any time. Unknown names are
/// not checked here.
ctrl_more::Status judgeResume(const std::vector<ctrl_more::ControllerStatus>& controllers,
                              const std::vector<std::string>& names, const std::string& reason);

}  // namespace coglab_controllers
