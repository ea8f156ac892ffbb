/// @file
/// What a request to the feedback controllers may carry, before Ctrl-MORE sees it
/// (coglab_msgs/FeedbackSelect.srv is the page of it).
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "ctrl_more/manager/controller_status.hpp"
#include "ctrl_more/states/status.hpp"

namespace coglab_controllers {

/// The longest reason of a request, in bytes of UTF-8.
inline constexpr std::size_t kLongestReason = 200;

/// Refuses a reason that could not be shown as it is: UTF-8 of at most kLongestReason bytes without
/// control characters, line breaks and marks of writing direction, and more than spaces; "" is
/// fine.
ctrl_more::Status judgeReason(const std::string& reason);

/// Refuses an empty name among the names of controllers: a list without a name is all of them.
ctrl_more::Status judgeNames(const std::vector<std::string>& names);

/// Refuses to withdraw a reason that nothing is paused for: each of the controllers named must be,
/// or any one if no name is given. "user" may be withdrawn at any time, and unknown names are left
/// to whoever knows the loaded ones.
ctrl_more::Status judgeResume(const std::vector<ctrl_more::ControllerStatus>& controllers,
                              const std::vector<std::string>& names, const std::string& reason);

}  // namespace coglab_controllers
