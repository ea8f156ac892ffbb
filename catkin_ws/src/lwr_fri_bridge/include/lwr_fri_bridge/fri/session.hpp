/// @file
/// The FRI session: which datagrams count, what was lost between them, and the header of the
/// answer.
///
/// Every datagram gets a verdict. Wrong size, wrong id, implausible content, doubled and
/// out-of-order ones are counted and not answered: an answer to them would only disturb the
/// controller's statistics. Lost ones show as gaps in the counter.
#pragma once

#include <cstddef>
#include <cstdint>

#include "lwr_fri_bridge/fri/set_point_history.hpp"

namespace lwr_fri_bridge::fri {

enum class Verdict : std::uint8_t {
  Accepted,
  WrongSize,    ///< not 916 bytes, or the header says so
  WrongId,      ///< not a measurement of the known version
  Implausible,  ///< a value is not finite or outside of what a controller can send, the set-point
                ///< does not follow from what was sent, the arm cannot have got where it was
                ///< measured, or the period changes in command mode
  Duplicate,    ///< same counter as the last accepted one
  OutOfOrder    ///< older than the last accepted one, or far ahead of it
};

/// What is counted, all since the bridge started.
struct SessionCounters {
  std::uint64_t accepted = 0;
  std::uint64_t wrong_size = 0;
  std::uint64_t wrong_id = 0;
  std::uint64_t implausible = 0;
  std::uint64_t duplicate = 0;
  std::uint64_t out_of_order = 0;
  std::uint64_t lost_measurements = 0;  ///< gaps in the controller's counter
  std::uint64_t lost_answers = 0;  ///< answers that the controller's next datagram does not reflect
  std::uint64_t restarts = 0;      ///< the controller's counter began anew
  std::uint64_t new_periods = 0;   ///< FRI was opened again with another period

  std::uint64_t rejected() const {
    return wrong_size + wrong_id + implausible + duplicate + out_of_order;
  }
};

/// What an accepted datagram says about the connection.
struct Reception {
  Verdict verdict = Verdict::WrongSize;
  std::uint32_t cycles = 1;     ///< cycles of the controller since the last accepted datagram, >= 1
  bool fresh_session = false;   ///< first datagram, or the controller's counter began anew
  bool new_period = false;      ///< FRI was opened again with another period
  bool answer_arrived = false;  ///< it reflects our last answer

  /// Whether the controller had to do without one of our answers, or we without a measurement.
  bool gap() const { return cycles > 1 || !answer_arrived; }
};

/// Real-time safe, one thread.
class Session {
 public:
  /// `lenient`: controllers that send zeros in the header are accepted. Order, losses and
  /// reflections cannot be told then.
  explicit Session(bool lenient) : lenient_(lenient) {}

  /// Judges a datagram; `measurement` is filled if and only if the verdict is Accepted.
  Reception receive(const std::uint8_t* bytes, std::size_t size, MeasurementDatagram& measurement);

  /// Header for the answer to the datagram accepted last; counts up.
  Header nextHeader();

  /// Notes what the answer with that header told the controller; fills in the counters.
  void sent(SentSetPoint set_point);
  /// What was sent; it outlives a restart of the controller's counter.
  SetPointHistory& history() { return history_; }

  /// After silence: the next datagram starts a fresh session, whatever its counter.
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

/// FRI period in s from the datagram, which must be plausible.
double cycleTimeOf(const MeasurementDatagram& measurement);

/// Whether all values that we use are finite and within what a controller can send.
bool plausible(const MeasurementDatagram& measurement);

}  // namespace lwr_fri_bridge::fri
