#include "ctrl_more/log/words.hpp"

#include <algorithm>
#include <cctype>

namespace ctrl_more {
namespace {

std::string lower(const std::string& text) {
  std::string result = text;
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

int editDistance(const std::string& a, const std::string& b) {
  std::vector<int> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = static_cast<int>(j);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    int diagonal = row[0];
    row[0] = static_cast<int>(i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const int above = row[j];
      const int change = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({above + 1, row[j - 1] + 1, change});
      diagonal = above;
    }
  }
  return row[b.size()];
}

}  // namespace

std::string nearestName(const std::string& wrong, const std::vector<std::string>& known) {
  if (wrong.empty() || wrong.size() > 100) return "";
  std::string best;
  int best_distance = std::max<int>(2, static_cast<int>(wrong.size()) / 3) + 1;
  const std::string w = lower(wrong);
  for (const std::string& name : known) {
    const std::string n = lower(name);
    int distance = editDistance(w, n);
    const bool contained =
        w.size() >= 3 && (n.find(w) != std::string::npos || w.find(n) != std::string::npos);
    if (contained && n.size() >= 3) distance = std::min(distance, 2);
    if (distance < best_distance) {
      best_distance = distance;
      best = name;
    }
  }
  return best;
}

std::string suggestion(const std::string& wrong, const std::vector<std::string>& known) {
  const std::string near = nearestName(wrong, known);
  if (!near.empty()) return "; did you mean '" + near + "'?";
  if (known.empty()) return "; there is none";
  std::string text = "; known:";
  for (std::size_t i = 0; i < known.size() && i < 20; ++i) {
    text += (i == 0 ? " " : ", ") + known[i];
  }
  return text + (known.size() > 20 ? ", ..." : "");
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace ctrl_more
