#include "ctrl_more/description/gains.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "ctrl_more/log/words.hpp"

namespace ctrl_more {

GainValues::GainValues(const std::vector<GainSpec>& specs) : specs_(specs) {
  for (const GainSpec& spec : specs_) {
    offsets_.push_back(static_cast<std::uint32_t>(values_.size()));
    values_.insert(values_.end(), spec.initial.begin(), spec.initial.end());
  }
}

Gain GainValues::find(const std::string& name) const {
  std::vector<std::string> known;
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    if (specs_[i].name == name) {
      Gain gain;
      gain.offset_ = offsets_[i];
      gain.size_ = static_cast<std::uint32_t>(specs_[i].size);
      return gain;
    }
    known.push_back(specs_[i].name);
  }
  throw std::invalid_argument("no gain '" + name + "' is declared" + suggestion(name, known));
}

Status GainValues::set(const std::string& name, const std::vector<double>& value) {
  std::vector<std::string> known;
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    const GainSpec& spec = specs_[i];
    known.push_back(spec.name);
    if (spec.name != name) continue;
    if (value.size() != 1 && static_cast<int>(value.size()) != spec.size) {
      return Status::failure("gain '" + name + "' expects " + std::to_string(spec.size) +
                             " numbers (or one for all), got " + std::to_string(value.size()));
    }
    for (const double v : value) {
      if (!std::isfinite(v) || v < spec.min || v > spec.max) {
        std::ostringstream text;
        text << "gain '" << name << "' expects " << spec.min << " to " << spec.max << " "
             << spec.unit << ", got " << v;
        return Status::failure(text.str());
      }
    }
    for (int k = 0; k < spec.size; ++k) {
      values_[offsets_[i] + k] = value.size() == 1 ? value[0] : value[k];
    }
    return {};
  }
  return Status::failure("no gain '" + name + "'" + suggestion(name, known), Cause::UnknownName);
}

std::map<std::string, std::vector<double>> GainValues::all() const {
  std::map<std::string, std::vector<double>> result;
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    const auto first = values_.begin() + offsets_[i];
    result[specs_[i].name] = std::vector<double>(first, first + specs_[i].size);
  }
  return result;
}

void GainValues::blend(const GainValues& from, const GainValues& to, double weight) {
  const std::size_t n = values_.size();
  if (from.values_.size() != n || to.values_.size() != n) return;
  if (weight >= 1.0) {
    std::copy(to.values_.begin(), to.values_.end(), values_.begin());
    return;
  }
  for (std::size_t i = 0; i < n; ++i) {
    values_[i] = from.values_[i] + weight * (to.values_[i] - from.values_[i]);
  }
}

void GainValues::assign(const GainValues& other) {
  if (other.values_.size() != values_.size()) return;
  std::copy(other.values_.begin(), other.values_.end(), values_.begin());
}

}  // namespace ctrl_more
