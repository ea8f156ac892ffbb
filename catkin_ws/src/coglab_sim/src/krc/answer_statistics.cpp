#include "coglab_sim/krc/answer_statistics.hpp"

#include <cmath>

namespace coglab_sim::krc {

using lwr_fri_bridge::fri::Quality;

void AnswerStatistics::add(bool answered, double latency) {
  Packet& slot = packets_[static_cast<std::size_t>(next_)];
  answered_ += static_cast<int>(answered) - static_cast<int>(slot.answered);
  slot = {answered, latency};
  next_ = (next_ + 1) % kWindow;
  if (!answered) ++misses_;
}

void AnswerStatistics::clear() {
  packets_.fill(Packet{});
  next_ = answered_ = 0;
}

double AnswerStatistics::latency() const {
  double sum = 0.0;
  for (const auto& packet : packets_) {
    if (packet.answered) sum += packet.latency;
  }
  return answered_ > 0 ? sum / answered_ : 0.0;
}

double AnswerStatistics::jitter() const {
  double sum = 0.0, last = 0.0;
  int pairs = -1;
  for (int i = 0; i < kWindow; ++i) {
    const Packet& packet = packets_[static_cast<std::size_t>((next_ + i) % kWindow)];
    if (!packet.answered) continue;
    if (++pairs > 0) sum += std::abs(packet.latency - last);
    last = packet.latency;
  }
  return pairs > 0 ? sum / pairs : 0.0;
}

Quality AnswerStatistics::quality() const {
  const double rate = answerRate();
  if (rate >= parameters_.quality_perfect) return Quality::Perfect;
  if (rate >= parameters_.quality_ok) return Quality::Ok;
  if (rate >= parameters_.quality_bad) return Quality::Bad;
  return Quality::Unacceptable;
}

}  // namespace coglab_sim::krc
