#pragma once

#include <string>

#include "ctrl_more/description.hpp"

namespace ctrl_more {

class FeedbackController;

/// What plot() prints of one controller: declaration, present state, signals, gains.
std::string plotText(const FeedbackController& controller);

/// The documentation page of a controller in Markdown, from its description alone.
std::string documentationPage(const Description& description);

/// A configuration file with every gain and setting at its initial value, each with unit, range
/// and text as a comment.
std::string configurationTemplate(const Description& description);

}  // namespace ctrl_more
