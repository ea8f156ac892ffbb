/// @file
/// The controller's statistics over the last 100 packets, and the resulting quality.
#pragma once

#include <array>
#include <cstdint>

#include "coglab_sim/krc/parameters.hpp"
#include "lwr_fri_bridge/fri/datagram.hpp"

namespace coglab_sim::krc {

/// Counts answered and missed packets. At the start the last 100 packets count as missed, so
/// quality rises only with answers.
class AnswerStatistics {
 public:
  explicit AnswerStatistics(const Parameters& parameters) : parameters_(parameters) {}

  /// Records one packet: answered in time or not, and the round trip, s.
  void add(bool answered, double latency);
  /// Clears everything except the total number of misses.
  void clear();

  double answerRate() const { return answered_ / static_cast<double>(kWindow); }
  double missRate() const { return 1.0 - answerRate(); }
  double latency() const;  ///< mean round trip of answered packets, s
  double jitter() const;   ///< mean absolute difference of successive round trips, s
  std::uint32_t missCounter() const { return misses_; }
  lwr_fri_bridge::fri::Quality quality() const;

 private:
  static constexpr int kWindow = 100;
  struct Packet {
    bool answered = false;
    double latency = 0.0;
  };
  const Parameters& parameters_;
  std::array<Packet, kWindow> packets_{};
  int next_ = 0;
  int answered_ = 0;
  std::uint32_t misses_ = 0;
};

}  // namespace coglab_sim::krc
