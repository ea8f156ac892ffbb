/// @file
/// The controller's statistics over the last 100 packets, and the quality it concludes from them.
#pragma once

#include <array>
#include <cstdint>

#include "coglab_sim/krc/parameters.hpp"
#include "lwr_fri_bridge/fri/datagram.hpp"

namespace coglab_sim::krc {

/// Counts answered and missed packets. Packets from before the first one count as missed, so
/// quality has to be earned.
class AnswerStatistics {
 public:
  explicit AnswerStatistics(const Parameters& parameters) : parameters_(parameters) {}

  /// Notes one packet: whether its answer came in time and the round trip it took, s.
  void add(bool answered, double latency);
  /// Forgets everything but the absolute number of misses.
  void clear();

  double answerRate() const { return answered_ / static_cast<double>(kWindow); }
  double missRate() const { return 1.0 - answerRate(); }
  double latency() const;  ///< mean round trip of the answered ones, s
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
