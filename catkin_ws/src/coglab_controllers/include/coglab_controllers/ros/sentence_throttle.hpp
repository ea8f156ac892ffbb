/// @file
/// Limits how often a sentence is logged, separately for each sentence.
#pragma once

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <iterator>
#include <map>
#include <string>

namespace coglab_controllers {

/// A fault that every message causes is logged from time to time and does not hide other faults.
/// Sentences that differ only in their digits count as the same.
class SentenceThrottle {
 public:
  explicit SentenceThrottle(double period) : period_ns_(static_cast<std::int64_t>(1e9 * period)) {}

  /// Returns true if this sentence may be logged now (steady clock, ns). One thread at a time.
  bool may(std::string sentence, std::int64_t now_ns) {
    sentence.erase(std::remove_if(sentence.begin(), sentence.end(),
                                  [](unsigned char letter) { return std::isdigit(letter) != 0; }),
                   sentence.end());
    if (last_.size() >= kMost && last_.count(sentence) == 0) forgetOld(now_ns);
    if (last_.size() >= kMost && last_.count(sentence) == 0) return false;
    const auto [place, first] = last_.try_emplace(std::move(sentence), now_ns);
    if (!first && now_ns - place->second < period_ns_) return false;
    place->second = now_ns;
    return true;
  }

 private:
  static constexpr std::size_t kMost = 64;  // names of frames and publishers come from outside

  void forgetOld(std::int64_t now_ns) {
    for (auto one = last_.begin(); one != last_.end();) {
      one = now_ns - one->second < period_ns_ ? std::next(one) : last_.erase(one);
    }
  }

  const std::int64_t period_ns_;
  std::map<std::string, std::int64_t> last_;
};

}  // namespace coglab_controllers
