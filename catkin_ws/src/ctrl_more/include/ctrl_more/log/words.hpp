#pragma once

#include <string>
#include <vector>

namespace ctrl_more {

/// Known name that is similar to a wrong one: letters swapped, missing or different, or one name
/// contained in the other. "" if there is none.
std::string nearestName(const std::string& wrong, const std::vector<std::string>& known);

/// End of the message about an unknown name: `; did you mean 'x'?` or, without a similar name,
/// `; known: a, b, c`.
std::string suggestion(const std::string& wrong, const std::vector<std::string>& known);

/// Names separated by commas.
std::string joined(const std::vector<std::string>& names);

}  // namespace ctrl_more
