#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "coglab_sim/cell_config.hpp"

using namespace coglab_sim;

namespace {

// The names once more, typed from what they mean: a row of the table that reads and writes the
// field of another name agrees with itself.
using P = krc::Parameters;
const std::map<std::string, double P::*> kKrc = {
    {"period", &P::period},
    {"quality_perfect", &P::quality_perfect},
    {"quality_ok", &P::quality_ok},
    {"quality_bad", &P::quality_bad},
    {"entry_position_tolerance", &P::entry_position_tolerance},
    {"entry_frame_tolerance", &P::entry_frame_tolerance},
    {"torque_tolerance", &P::torque_tolerance},
    {"t1_speed_limit", &P::t1_speed_limit},
    {"speed_margin", &P::speed_margin},
    {"frame_speed_limit", &P::frame_speed_limit},
    {"frame_turn_limit", &P::frame_turn_limit},
    {"frame_orthonormality", &P::frame_orthonormality},
    {"torque_limit_time", &P::torque_limit_time},
    {"joint_stiffness_max", &P::joint_stiffness_max},
    {"frame_stiffness_max", &P::frame_stiffness_max},
    {"rotation_stiffness_max", &P::rotation_stiffness_max},
    {"joint_stiffness", &P::joint_stiffness},
    {"frame_stiffness", &P::frame_stiffness},
    {"rotation_stiffness", &P::rotation_stiffness},
    {"damping", &P::damping},
    {"krl_poll", &P::krl_poll},
    {"krl_message_wait", &P::krl_message_wait},
    {"krl_drive_wait", &P::krl_drive_wait},
    {"krl_quality_wait", &P::krl_quality_wait},
    {"brake_release", &P::brake_release},
    {"power_up", &P::power_up},
    {"close_linger", &P::close_linger},
    {"ambient_temperature", &P::ambient_temperature},
    {"drive_heating", &P::drive_heating},
    {"drive_heating_time", &P::drive_heating_time},
    {"drive_warning", &P::drive_warning}};
using S = krc::ServoParameters;
const std::map<std::string, double S::*> kServos = {{"payload_error", &S::payload_error},
                                                    {"inertia_error", &S::inertia_error}};
const std::map<std::string, double TorqueNoise::*> kNoise = {
    {"sigma", &TorqueNoise::sigma},
    {"speed_gain", &TorqueNoise::speed_gain},
    {"correlation_time", &TorqueNoise::correlation_time},
    {"bias", &TorqueNoise::bias},
    {"offset", &TorqueNoise::offset},
    {"hysteresis", &TorqueNoise::hysteresis},
    {"hysteresis_speed", &TorqueNoise::hysteresis_speed}};

/// Another value than the one that is there; no two numbers of a list are equal.
ParameterValue another(const CellParameter& parameter, ParameterValue value) {
  const auto moved = [&](double number, double share) {
    const double up = number + share * (parameter.high - number);
    return up > number ? up : parameter.low + (1.0 - share) * (number - parameter.low);
  };
  if (auto* flag = std::get_if<bool>(&value)) *flag = !*flag;
  if (auto* whole = std::get_if<int>(&value)) *whole += *whole < parameter.high ? 1 : -1;
  if (auto* number = std::get_if<double>(&value)) *number = moved(*number, 0.3);
  if (auto* list = std::get_if<std::vector<double>>(&value)) {
    if (parameter.name == "object/rotation") return std::vector<double>{0.0, 0.6, 0.0, 0.8};
    for (std::size_t i = 0; i < list->size(); ++i)
      (*list)[i] = moved((*list)[i], 0.3 + 0.02 * static_cast<double>(i));
    if (parameter.unit == "counts") *list = {11.0, 12.0, 13.0, 14.0, 15.0};
  }
  if (auto* text = std::get_if<std::string>(&value)) {
    const std::map<std::string, std::string> words = {{"krc/convention", "stanford"},
                                                      {"krc/mode", "T1"},
                                                      {"object/shape", "sphere"},
                                                      {"object/start", "world"}};
    const auto found = words.find(parameter.name);
    *text = found != words.end() ? found->second : *text + "x";
  }
  return value;
}

}  // namespace

TEST(CellConfig, EveryParameterChangesItselfAndNothingElse) {
  const CellConfig untouched;
  for (const CellParameter& parameter : cellParameters()) {
    SCOPED_TRACE(parameter.name);
    EXPECT_FALSE(parameter.description.empty());
    EXPECT_TRUE(parameter.source == "published" || parameter.source == "ours" ||
                parameter.source == "set-up");
    CellConfig config;
    const ParameterValue value = another(parameter, parameter.get(untouched));
    ASSERT_FALSE(value == parameter.get(untouched));
    setCellParameter(config, parameter.name, value);
    EXPECT_TRUE(parameter.get(config) == value);
    for (const CellParameter& other : cellParameters()) {
      if (other.name == parameter.name) continue;
      EXPECT_TRUE(other.get(config) == other.get(untouched)) << "it also changed " << other.name;
    }
  }
  CellConfig config;
  EXPECT_THROW(setCellParameter(config, "krc/nothing", 1.0), std::invalid_argument);
  EXPECT_THROW(setCellParameter(config, "krc/period", std::string("fast")), std::invalid_argument);
  EXPECT_THROW(setCellParameter(config, "home", std::vector<double>{1.0}), std::invalid_argument);
}

TEST(CellConfig, ANumberIsSetInTheFieldOfItsName) {
  std::size_t numbers = 0;
  for (const CellParameter& parameter : cellParameters()) {
    SCOPED_TRACE(parameter.name);
    const std::size_t slash = parameter.name.find('/') + 1;
    const std::string group = parameter.name.substr(0, slash), name = parameter.name.substr(slash);
    CellConfig config;
    const ParameterValue value = another(parameter, parameter.get(config));
    const auto* number = std::get_if<double>(&value);
    if (number == nullptr || (group != "krc/" && kKrc.count(name) + kNoise.count(name) == 0))
      continue;
    setCellParameter(config, parameter.name, value);
    if (group == "krc/") {
      ASSERT_EQ(kKrc.count(name) + kServos.count(name), 1U) << "type its field here";
      EXPECT_EQ(kKrc.count(name) ? config.krc.*kKrc.at(name) : config.servos.*kServos.at(name),
                *number);
      ++numbers;
    } else if (group == "torque_noise/") {
      EXPECT_EQ(config.torque_noise.*kNoise.at(name), *number);
      ++numbers;
    }
  }
  EXPECT_EQ(numbers, kKrc.size() + kServos.size() + kNoise.size());
}

TEST(CellConfig, AnythingElseIsSetInTheFieldOfItsName) {
  CellConfig config;
  setCellParameter(config, "seed", 77);
  setCellParameter(config, "home", std::vector<double>{0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7});
  setCellParameter(config, "krc/mode", std::string("T2"));
  setCellParameter(config, "krc/convention", std::string("rtt_lwr"));
  setCellParameter(config, "krc/entry_quality", 3);
  setCellParameter(config, "krc/extrapolated_packets", 7);
  setCellParameter(config, "krc/acknowledge_by_program", false);
  EXPECT_EQ(config.seed, 77U);
  for (int i = 0; i < 7; ++i) EXPECT_DOUBLE_EQ(config.home[i], 0.1 * (i + 1)) << i;
  EXPECT_EQ(config.krc.mode, krc::OperatingMode::T2);
  EXPECT_EQ(config.krc.convention, krc::KrlConvention::RttLwr);
  EXPECT_EQ(config.krc.entry_quality, 3);
  EXPECT_EQ(config.krc.extrapolated_packets, 7);
  EXPECT_FALSE(config.krc.acknowledge_by_program);
}
