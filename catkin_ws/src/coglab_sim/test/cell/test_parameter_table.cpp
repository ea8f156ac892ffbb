/// The table of parameters: every row is checked with its own range and type.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "coglab_sim/cell_config.hpp"
#include "coglab_sim/ranges.hpp"

using namespace coglab_sim;

namespace {

/// Another value than the one that is there; no two numbers of a list are equal.
ParameterValue another(const CellParameter& row, ParameterValue value) {
  const auto moved = [&](double number, double share) {
    const double up = number + share * (row.high - number);
    return up > number ? up : row.low + (1.0 - share) * (number - row.low);
  };
  if (auto* flag = std::get_if<bool>(&value)) *flag = !*flag;
  if (auto* whole = std::get_if<int>(&value)) *whole += *whole < row.high ? 1 : -1;
  if (auto* number = std::get_if<double>(&value)) *number = moved(*number, 0.3);
  if (auto* list = std::get_if<std::vector<double>>(&value)) {
    if (row.name == "object/rotation") return std::vector<double>{0.0, 0.6, 0.0, 0.8};
    for (std::size_t i = 0; i < list->size(); ++i)
      (*list)[i] = moved((*list)[i], 0.3 + 0.02 * static_cast<double>(i));
  }
  if (auto* text = std::get_if<std::string>(&value)) {
    const std::map<std::string, std::string> choices = {{"krc/convention", "stanford"},
                                                        {"krc/mode", "T1"}};
    const auto found = choices.find(row.name);
    *text = found != choices.end() ? found->second : *text + "x";
  }
  return value;
}

/// The value with this number in it, in the last place of a list.
ParameterValue with(ParameterValue value, double number) {
  if (auto* list = std::get_if<std::vector<double>>(&value)) {
    list->back() = number;
    return value;
  }
  return number;
}

std::string refusal(const CellParameter& row, const ParameterValue& value) {
  CellConfig config;
  try {
    row.set(config, value);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST(ParameterTable, ARowChangesItselfAndNothingElse) {
  const CellConfig untouched;
  std::set<std::string> names;
  for (const CellParameter& row : cellParameters()) {
    SCOPED_TRACE(row.name);
    EXPECT_TRUE(names.insert(row.name).second) << "twice";
    EXPECT_FALSE(row.text.empty());
    EXPECT_TRUE(row.source == "published" || row.source == "ours" || row.source == "set-up");
    CellConfig config;
    const ParameterValue value = another(row, row.get(untouched));
    ASSERT_FALSE(value == row.get(untouched));
    row.set(config, value);
    EXPECT_TRUE(row.get(config) == value);
    for (const CellParameter& other : cellParameters()) {
      if (other.name == row.name) continue;
      EXPECT_TRUE(other.get(config) == other.get(untouched)) << "it also changed " << other.name;
    }
  }
}

TEST(ParameterTable, NamesAreThoseOfTheFields) {
#define KRC(type, field, value, name, ...) EXPECT_EQ(std::string("krc/") + #field, name);
#define TORQUE_NOISE(type, field, value, name, ...) \
  EXPECT_EQ(std::string("torque_noise/") + #field, name);
#define OBJECT(type, field, value, name, ...) EXPECT_EQ(std::string("object/") + #field, name);
#define NODE(type, field, value, name, ...) EXPECT_EQ(std::string(#field), name);
#include "coglab_sim/parameter_table.inc"
}

TEST(ParameterTable, BothEndsOfARangeAreTakenAndNothingBeyond) {
  const CellConfig defaults;
  for (const CellParameter& row : cellParameters()) {
    SCOPED_TRACE(row.name);
    const ParameterValue value = row.get(defaults);
    const bool number = !std::holds_alternative<bool>(value) && !std::get_if<std::string>(&value);
    EXPECT_EQ(row.low < row.high, number);
    EXPECT_EQ(refusal(row, value), "") << "its own default";
    if (!number || row.name == "object/rotation") continue;
    EXPECT_EQ(rangeOf(row.name).high, row.high);
    EXPECT_EQ(refusal(row, with(value, row.low)), "");
    EXPECT_EQ(refusal(row, with(value, row.high)), "");
    for (const double beyond : {row.low - 1e-3, row.high * 1.001 + 1e-3, std::nan("")}) {
      const std::string said = refusal(row, with(value, beyond));
      EXPECT_NE(said.find("parameter " + row.name), std::string::npos) << said;
      EXPECT_NE(said.find("its range "), std::string::npos) << said;
    }
  }
}

TEST(ParameterTable, OtherTypesAndUnknownNamesAreRefused) {
  CellConfig config;
  const std::vector<double> one{1.0}, too_long{0.0, 0.0, 0.0, 2.0};
  for (const auto& [name, value] : std::vector<std::pair<std::string, ParameterValue>>{
           {"krc/nothing", 1.0},
           {"speed", 1.0},  // of cell_node alone
           {"fault/silence", 1.0},
           {"krc/period", std::string("fast")},
           {"krc/period", true},
           {"krc/acknowledge_by_program", 1},
           {"krc/convention", std::string("nobody")},
           {"krc/convention", 3},
           {"krc/mode", std::string("T3")},
           {"home", one},
           {"object/rotation", too_long}}) {
    try {
      setCellParameter(config, name, value);
      ADD_FAILURE() << name;
    } catch (const std::invalid_argument&) {
    }
  }
}
