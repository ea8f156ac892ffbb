#include "coglab_controllers/manager/tunables.hpp"

#include <sstream>

namespace coglab_controllers {

Answer Tunables::set(const std::map<std::string, double>& values) {
  const auto find = [this](const std::string& name) {
    return std::find_if(all_.begin(), all_.end(), [&](const Tunable& t) { return t.name == name; });
  };
  for (const auto& [name, value] : values) {
    const auto found = find(name);
    std::ostringstream why;
    if (found == all_.end()) {
      why << "no gain named " << name << "; there are:";
      for (const Tunable& one : all_) why << " " << one.name;
      return Answer::invalid(why.str());
    }
    if (!(value >= found->least && value <= found->most)) {
      why << name << ": expected a number from " << found->least << " to " << found->most
          << ", got " << value;
      return Answer::refusal(
          std::isfinite(value) ? ReasonCode::OutOfRange : ReasonCode::InvalidArgument, why.str());
    }
  }
  for (const auto& [name, value] : values) find(name)->set(value);
  return {};
}

}  // namespace coglab_controllers
