#include "coglab_controllers/motion/custom_motion_controller.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace coglab_controllers {

CustomMotionController::CustomMotionController(std::unique_ptr<Motion<>> motion)
    : MotionRunner<MotionArguments>(std::move(motion), RunnerPolicy()) {}

MotionController* CustomMotionController::make(std::unique_ptr<Motion<>> motion,
                                               const ctrl_more::Abi& library) {
  constexpr ctrl_more::Abi program = customMotionAbi();
  if (library == program) return new CustomMotionController(std::move(motion));
  throw std::runtime_error("its motion is " + library.otherThan("coglab_controllers", program));
}

CustomMotionController::~CustomMotionController() = default;

void CustomMotionController::report(std::int64_t stamp_ns) { progress_.write(progress(stamp_ns)); }

std::string CustomMotionController::describeArguments() const {
  std::ostringstream text;
  for (const MotionArgument& argument : arguments()) {
    text << argument.name << ": " << argument.fallback << " " << argument.unit << ", "
         << argument.least << " to " << argument.most << "\n";
  }
  return text.str();
}

Answer CustomMotionController::readArguments(const MotionRequestByName& request,
                                             MotionArguments& values) const {
  const std::vector<MotionArgument>& known = arguments();
  for (std::size_t i = 0; i < known.size(); ++i) values.values[i] = known[i].fallback;
  if (request.names.size() != request.values.size()) {
    return Answer::invalid("start_motion has " + std::to_string(request.names.size()) +
                           " names and " + std::to_string(request.values.size()) +
                           " values; expected one value for each name");
  }
  for (std::size_t i = 0; i < request.names.size(); ++i) {
    const std::string& name = request.names[i];
    const double value = request.values[i];
    const auto found = std::find_if(known.begin(), known.end(), [&name](const MotionArgument& one) {
      return one.name == name;
    });
    if (found == known.end()) {
      return Answer::refusal(ReasonCode::UnknownName,
                             "'" + name + "' is no argument of this motion; it has " +
                                 (known.empty() ? "none" : "these:\n" + describeArguments()));
    }
    if (!std::isfinite(value) || value < found->least || value > found->most) {
      std::ostringstream why;
      why << name << " is " << value << " " << found->unit << "; expected " << found->least
          << " to " << found->most;
      return Answer::refusal(
          std::isfinite(value) ? ReasonCode::OutOfRange : ReasonCode::InvalidArgument, why.str());
    }
    values.values[static_cast<std::size_t>(found - known.begin())] = value;
  }
  return {};
}

MotionAnswer CustomMotionController::startMotion(const MotionRequestByName& request) {
  const MotionRequest begun = setup().host->beginRequest(id());
  if (!begun.welcome.success) return MotionAnswer::rejected(begun.welcome);
  MotionArguments values;
  const Answer read = readArguments(request, values);
  if (!read.success) return MotionAnswer::rejected(read);
  return offer(begun, values, request.queue);
}

}  // namespace coglab_controllers
