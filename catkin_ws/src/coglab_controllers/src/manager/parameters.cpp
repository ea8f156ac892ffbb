#include "coglab_controllers/manager/parameters.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace coglab_controllers {

Parameters::Parameters(const YAML::Node& node, std::string block)
    : node_(node), block_(std::move(block)) {
  if (node_.IsDefined() && !node_.IsNull() && !node_.IsMap()) {
    throw std::runtime_error("parameter " + block_ + ": expected a block of parameters");
  }
}

bool Parameters::has(const std::string& name) const {
  return node_.IsDefined() && node_.IsMap() && node_[name].IsDefined() && !node_[name].IsNull();
}

void Parameters::refuse(const std::string& name, const std::string& expected) const {
  std::ostringstream got;
  if (has(name)) {
    got << YAML::Node(node_[name]);
  } else {
    got << "nothing";
  }
  throw std::runtime_error("parameter " + block_ + "/" + name + ": expected " + expected +
                           ", got " + got.str());
}

double Parameters::number(const std::string& name, double fallback, double least,
                          double most) const {
  if (!has(name)) return fallback;
  std::ostringstream expected;
  expected << "a number from " << least << " to " << most;
  try {
    const double value = node_[name].as<double>();
    if (std::isfinite(value) && value >= least && value <= most) return value;
  } catch (const YAML::Exception&) {
  }
  refuse(name, expected.str());
}

int Parameters::whole(const std::string& name, int fallback, int least, int most) const {
  if (!has(name)) return fallback;
  try {
    const int value = node_[name].as<int>();
    if (value >= least && value <= most) return value;
  } catch (const YAML::Exception&) {
  }
  refuse(name, "a whole number from " + std::to_string(least) + " to " + std::to_string(most));
}

bool Parameters::flag(const std::string& name, bool fallback) const {
  if (!has(name)) return fallback;
  try {
    return node_[name].as<bool>();
  } catch (const YAML::Exception&) {
  }
  refuse(name, "true or false");
}

std::string Parameters::text(const std::string& name, const std::string& fallback) const {
  if (!has(name)) return fallback;
  if (!node_[name].IsScalar()) refuse(name, "a text");
  return node_[name].as<std::string>();
}

std::string Parameters::choice(const std::string& name, const std::string& fallback,
                               const std::vector<std::string>& allowed) const {
  const std::string value = text(name, fallback);
  if (std::find(allowed.begin(), allowed.end(), value) != allowed.end()) return value;
  std::string list;
  for (const std::string& word : allowed) list += (list.empty() ? "" : " or ") + word;
  refuse(name, list);
}

std::vector<std::string> Parameters::texts(const std::string& name) const {
  if (!has(name)) return {};
  try {
    return node_[name].as<std::vector<std::string>>();
  } catch (const YAML::Exception&) {
  }
  refuse(name, "a list of texts");
}

Eigen::VectorXd Parameters::numbers(const std::string& name, const Eigen::VectorXd& fallback,
                                    double most) const {
  if (!has(name)) return fallback;
  try {
    const std::vector<double> values = node_[name].as<std::vector<double>>();
    const Eigen::VectorXd result =
        Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<int>(values.size()));
    if (result.size() == fallback.size() && result.allFinite() &&
        result.lpNorm<Eigen::Infinity>() <= most) {
      return result;
    }
  } catch (const YAML::Exception&) {
  }
  std::ostringstream range;
  range << fallback.size() << " finite numbers from " << -most << " to " << most;
  refuse(name, range.str());
}

Parameters Parameters::block(const std::string& name) const {
  return Parameters(has(name) ? node_[name] : YAML::Node(), block_ + "/" + name);
}

}  // namespace coglab_controllers
