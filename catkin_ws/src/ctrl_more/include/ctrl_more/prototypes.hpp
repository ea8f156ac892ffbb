#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "ctrl_more/abi.hpp"
#include "ctrl_more/feedback_controller.hpp"

namespace ctrl_more {

/// Makes one controller; the caller owns it. The paper's type for its prototypes.
using FeedbackControllerMaker = FeedbackController* (*)();

/// The shared map of controller types (Ctrl-MORE paper, section V-B): every plug-in library puts
/// its makers in when it is loaded. Unlike a plain map it remembers refused insertions, so that a
/// library which registers a known name is told so.
///
/// Threads: used under the loader's lock only; never in the cycle.
class FeedbackControllerPrototypes {
 public:
  /// Registers a maker under a type name, as the paper's listing does:
  /// `feedbackControllerPrototypes.insert({"MyController", feedbackExampleMaker});`
  /// @param entry type name and maker
  /// @param abi what the caller was compiled with; leave it out
  /// @return false, and a note for the loader, if the name is known already or the ABI is another
  ///         one
  bool insert(const std::pair<const std::string, FeedbackControllerMaker>& entry,
              const Abi& abi = thisAbi());

  /// Removes a type name, if its maker is this one.
  void erase(const std::string& type, FeedbackControllerMaker maker);

  /// Maker of a type, null if unknown.
  FeedbackControllerMaker find(const std::string& type) const;

  /// All known type names, sorted.
  std::vector<std::string> types() const;

  /// What was refused since the last call, one clause each; the list is emptied.
  std::vector<std::string> takeRefused();

 private:
  std::map<std::string, FeedbackControllerMaker> makers_;
  std::vector<std::string> refused_;
};

/// The map itself, one per process. A function, so that it exists before any library's static
/// objects run.
FeedbackControllerPrototypes& prototypes();

/// The same under the name that the paper's listing uses.
[[maybe_unused]] static FeedbackControllerPrototypes& feedbackControllerPrototypes =
    prototypes();

/// Registers for as long as the library is loaded. Used by the macro below.
class PrototypeRegistration {
 public:
  /// Inserts.
  PrototypeRegistration(const char* type, FeedbackControllerMaker maker,
                        const Abi& abi = thisAbi())
      : type_(type), maker_(maker) {
    prototypes().insert({type_, maker_}, abi);
  }
  /// Erases.
  ~PrototypeRegistration() { prototypes().erase(type_, maker_); }
  PrototypeRegistration(const PrototypeRegistration&) = delete;
  PrototypeRegistration& operator=(const PrototypeRegistration&) = delete;

 private:
  std::string type_;
  FeedbackControllerMaker maker_;
};

}  // namespace ctrl_more

/// Registers a controller class from its source file:
/// `CTRL_MORE_REGISTER_CONTROLLER(my_lab::WristDamper, "WristDamper")`. The name must be the one
/// in describe().type. Use it once per library, outside of any namespace.
#define CTRL_MORE_REGISTER_CONTROLLER(Class, type)                                        \
  namespace {                                                                             \
  ::ctrl_more::FeedbackController* ctrlMoreMaker() { return new Class(); }                \
  const ::ctrl_more::PrototypeRegistration ctrl_more_registration(type, &ctrlMoreMaker); \
  }
