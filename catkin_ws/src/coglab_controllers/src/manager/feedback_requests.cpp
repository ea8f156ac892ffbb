#include "coglab_controllers/manager/feedback_requests.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdio>

#include "ctrl_more/log/words.hpp"

namespace coglab_controllers {
namespace {

using ctrl_more::Cause;
using ctrl_more::ControllerStatus;
using ctrl_more::PauseCause;
using ctrl_more::Status;

// Reads the character at `place` and advances. False if the bytes are not UTF-8; overlong forms,
// surrogates and numbers above 0x10ffff are not UTF-8 either.
bool readCharacter(const std::string& text, std::size_t& place, std::uint32_t& character) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t first = byte(place++);
  character = first;
  if (first < 0x80) return true;
  const int more = first >= 0xf0 ? 3 : first >= 0xe0 ? 2 : 1;
  if (first < 0xc2 || first > 0xf4 || text.size() - place < static_cast<std::size_t>(more)) {
    return false;
  }
  character = first & (0x3f >> more);
  for (int i = 0; i < more; ++i, ++place) {
    if ((byte(place) & 0xc0) != 0x80) return false;
    character = character << 6 | (byte(place) & 0x3f);
  }
  const bool shortest = character >= (more == 3 ? 0x10000u : more == 2 ? 0x800u : 0x80u);
  return shortest && character <= 0x10ffff && !(character >= 0xd800 && character <= 0xdfff);
}

// Characters that change the display of the rest of a line: control characters, breaks of lines and
// paragraphs, marks of writing direction.
bool steersTheDisplay(std::uint32_t c) {
  return c < 0x20 || (c >= 0x7f && c < 0xa0) || c == 0x61c || c == 0x200e || c == 0x200f ||
         (c >= 0x2028 && c <= 0x202e) || (c >= 0x2066 && c <= 0x2069);
}

bool isSpace(std::uint32_t c) {
  return c == ' ' || c == 0xa0 || c == 0x1680 || (c >= 0x2000 && c <= 0x200a) || c == 0x202f ||
         c == 0x205f || c == 0x3000;
}

Status badReason(const std::string& what) {
  return Status::failure("reason " + what + "; expected printable text of at most " +
                         std::to_string(kLongestReason) + " bytes, or none for 'user'");
}

bool fits(const ControllerStatus& controller, const std::string& reason) {
  for (std::size_t i = 0; i < controller.reasons.size(); ++i) {
    // A fault is listed with its text, but is withdrawn by the reason "fault".
    if (controller.causes[i] == PauseCause::Fault ? reason == "fault"
                                                  : reason == controller.reasons[i]) {
      return true;
    }
  }
  return false;
}

std::string pausedFor(const ControllerStatus& controller) {
  return controller.name + (controller.paused ? " for " + ctrl_more::joined(controller.reasons)
                                              : " for no reason, it is not paused");
}

}  // namespace

Status judgeReason(const std::string& reason) {
  if (reason.empty()) return {};
  if (reason.size() > kLongestReason) {
    return badReason("has " + std::to_string(reason.size()) + " bytes");
  }
  bool visible = false;
  for (std::size_t place = 0; place < reason.size();) {
    const std::string where = " at byte " + std::to_string(place);
    std::uint32_t character = 0;
    if (!readCharacter(reason, place, character)) return badReason("is no UTF-8" + where);
    if (steersTheDisplay(character)) {
      char number[16];
      std::snprintf(number, sizeof number, "U+%04X", static_cast<unsigned>(character));
      return badReason(std::string("has the unprintable character ") + number + where);
    }
    visible = visible || !isSpace(character);
  }
  return visible ? Status() : badReason("has only spaces");
}

Status judgeNames(const std::vector<std::string>& names) {
  const auto empty = std::find(names.begin(), names.end(), "");
  if (empty == names.end()) return {};
  return Status::failure("names[" + std::to_string(empty - names.begin()) +
                         "] is empty; expected names of loaded controllers, or a list without "
                         "any name for all of them");
}

Status judgeResume(const std::vector<ControllerStatus>& controllers,
                   const std::vector<std::string>& names, const std::string& reason) {
  if (reason == "user") return {};
  bool found = false;
  std::string others;
  for (const ControllerStatus& controller : controllers) {
    const bool named = std::count(names.begin(), names.end(), controller.name) != 0;
    if (!named && !names.empty()) continue;
    if (fits(controller, reason)) {
      found = true;
    } else {
      others += (others.empty() ? "" : "; ") + pausedFor(controller);
    }
  }
  if (others.empty() || (names.empty() && found)) return {};
  return Status::failure("reason '" + reason +
                             "' is none that can be withdrawn; expected one of those in " +
                             "feedback/status, where is paused: " + others,
                         Cause::UnknownName);
}

}  // namespace coglab_controllers
