/// @file
/// The FRI session. It accepts or rejects datagrams, counts losses, and makes the header of the
/// answer.
///
/// Every datagram gets a verdict. Datagrams with wrong size, wrong id or implausible content,
/// duplicates and out-of-order ones are counted and not answered: an answer would disturb the
/// controller's statistics. Lost datagrams appear as gaps in the counter.
#pragma once

#include <cstddef>
#include <cstdint>

#include "lwr_fri_bridge/fri/set_point_history.hpp"

namespace lwr_fri_bridge::fri {

enum class Verdict : std::uint8_t {
  Accepted,
  WrongSize,    ///< the datagram or the size in its header is not 916 bytes
  WrongId,      ///< not a measurement of the known version
  Implausible,  ///< a value is not finite or out of the controller's range, the set-point does not
                ///< follow from the sent answers, the arm cannot have reached the measured
                ///< position, or the period changes in command mode
  Duplicate,    ///< same counter as the last accepted one
  OutOfOrder    ///< older than the last accepted one, or far ahead of it
};

/// Counters since the start of the bridge.
struct SessionCounters {
  std::uint64_t accepted = 0;
  std::uint64_t wrong_size = 0;
  std::uint64_t wrong_id = 0;
  std::uint64_t implausible = 0;
  std::uint64_t duplicate = 0;
  std::uint64_t out_of_order = 0;
  std::uint64_t lost_measurements = 0;  ///< gaps in the controller's counter
  std::uint64_t lost_answers = 0;  ///< answers that the controller's next datagram does not reflect
  std::uint64_t restarts = 0;      ///< the controller's counter restarted
  std::uint64_t new_periods = 0;   ///< FRI was opened again with another period

  std::uint64_t rejected() const {
    return wrong_size + wrong_id + implausible + duplicate + out_of_order;
  }
};

/// State of the connection after an accepted datagram.
struct Reception {
  Verdict verdict = Verdict::WrongSize;
  std::uint32_t cycles = 1;     ///< cycles of the controller since the last accepted datagram, >= 1
  bool fresh_session = false;   ///< first datagram, or the controller's counter restarted
  bool new_period = false;      ///< FRI was opened again with another period
  bool answer_arrived = false;  ///< the datagram reflects our last answer

  /// True if an answer or a measurement was lost.
  bool gap() const { return cycles > 1 || !answer_arrived; }
};

/// Real-time safe, one thread.
class Session {
 public:
  /// `lenient`: accept controllers that send zeros in the header. Order, losses and reflections are
  /// then unknown.
  explicit Session(bool lenient) : lenient_(lenient) {}

  /// Checks a datagram. `measurement` is filled if and only if the verdict is Accepted.
  Reception receive(const std::uint8_t* bytes, std::size_t size, MeasurementDatagram& measurement);

  /// Header for the answer to the last accepted datagram. Increases the counter.
  Header nextHeader();

  /// Records the set-point of the answer with that header. Fills in the counters.
  void sent(SentSetPoint set_point);
  /// Sent set-points. A restart of the controller's counter does not clear them.
  SetPointHistory& history() { return history_; }

  /// Call this after silence. The next datagram starts a fresh session with any counter.
  void forget();

  const SessionCounters& counters() const { return counters_; }

 private:
  Verdict checkForm(const std::uint8_t* bytes, std::size_t size, MeasurementDatagram& candidate);
  bool provesRestart(const MeasurementDatagram& candidate);
  void accept(const MeasurementDatagram& candidate, const Reception& reception);
  Verdict checkOrder(const MeasurementDatagram& candidate, Reception& reception);
  bool leaps(const MeasurementDatagram& candidate, std::uint32_t cycles) const;
  bool newPeriod(const MeasurementDatagram& candidate) const;

  bool lenient_;
  bool connected_ = false;
  bool answered_ = false;       // an answer was sent in this session
  std::uint16_t received_ = 0;  // counter of the last accepted measurement
  std::uint16_t sent_ = 0;      // counter of our last answer
  std::uint16_t suspect_ = 0;   // counter of the last datagram out of order
  int suspects_in_a_row_ = 0;
  float set_point_[kJoints] = {};  // of the last accepted measurement
  float measured_[kJoints] = {};
  SetPointHistory history_;
  double period_ = 0.0;  // s, of the last accepted measurement
  SessionCounters counters_;
};

/// FRI period of a plausible datagram, s.
double cycleTimeOf(const MeasurementDatagram& measurement);

/// True if all used values are finite and within the range of a controller.
bool plausible(const MeasurementDatagram& measurement);

}  // namespace lwr_fri_bridge::fri
