#pragma once

#include <string>
#include <vector>

namespace ctrl_more {

/// The known name nearest to a wrong one, "" if none is near: letters swapped, missing or
/// different, or one contained in the other.
std::string nearestName(const std::string& wrong, const std::vector<std::string>& known);

/// What to add to the sentence about an unknown name: `; did you mean 'x'?` or, if no name is
/// near, `; known: a, b, c`.
std::string suggestion(const std::string& wrong, const std::vector<std::string>& known);

/// Names separated by commas.
std::string joined(const std::vector<std::string>& names);

}  // namespace ctrl_more
