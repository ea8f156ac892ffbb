/// @file
/// Evidence of one source for a contact, and the event that follows.
#pragma once

#include <string>

namespace coglab_contact {

/// Probability that counts as a contact; one source at its threshold is sufficient.
constexpr double kDecided = 0.99;
/// Logits per unit of margin: at 0.8 of its threshold a source gives 0.9, at 0.6 it gives 0.5.
constexpr double kSteepness = 12.0;

/// Probability of a contact from a margin (signal over threshold): 0.99 at 1.
double probability(double margin);

/// Evidence of one source at one time (s), valid until `until` (s).
struct Evidence {
  std::string source;
  double stamp = 0.0;
  double until = 0.0;
  double margin = 0.0;  ///< signal over threshold
  std::string message;
};

/// Code of an event, as in coglab_msgs/ReasonCode.
enum class Found : int { contact = 620, early = 621, carried = 622, released = 623 };

/// Contact detected (`contact`) or load released (not `contact`); fields of coglab_msgs/Contact.
struct ContactEvent {
  bool contact = true;
  std::string source;
  double margin = 0.0;  ///< signal over threshold
  std::string message;
  double confidence = 1.0;  ///< probability (0..1) that the signal is over its threshold
  int code = 0;             ///< ReasonCode of the message

  bool operator==(const ContactEvent& other) const {
    return contact == other.contact && source == other.source && margin == other.margin &&
           message == other.message && confidence == other.confidence && code == other.code;
  }
};

}  // namespace coglab_contact
