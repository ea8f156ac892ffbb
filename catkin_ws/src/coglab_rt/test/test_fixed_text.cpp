/// Text that is composed without allocation.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <random>
#include <string>

#include "coglab_rt/fixed_text.hpp"

namespace coglab_rt {
namespace {

TEST(FixedText, IsCutAndAlwaysTerminated) {
  FixedText<8> text("abc");
  text << "defghij" << std::uint64_t{42};
  EXPECT_EQ(text.str(), "abcdefg");
  EXPECT_EQ(text.c_str()[7], '\0');
  text.clear();
  EXPECT_TRUE(text.empty());
  EXPECT_STREQ(text.c_str(), "");
  text << static_cast<const char*>(nullptr);
  EXPECT_TRUE(text.empty());
}

TEST(FixedText, NumbersReadAsTheCLibraryWritesThem) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> size(-5.0, 12.0);
  for (int i = 0; i < 20000; ++i) {
    const double value = (i % 2 == 0 ? 1.0 : -1.0) * std::pow(10.0, size(random));
    FixedText<64> text;
    text << value;
    EXPECT_NEAR(std::stod(text.str()), value, 0.0005 + 1e-12 * std::abs(value)) << text.c_str();
  }
  FixedText<64> largest;
  largest << std::numeric_limits<std::uint64_t>::max();
  EXPECT_EQ(largest.str(), "18446744073709551615");
  FixedText<64> odd;
  odd << std::nan("") << " " << INFINITY << " " << 1e300;
  EXPECT_EQ(odd.str(), "nan inf >1e15");
}

TEST(FixedText, EqualityIsThatOfTheText) {
  FixedText<8> one("abc"), other("abd");
  EXPECT_NE(one, other);
  other.clear();
  other << "abc";
  EXPECT_EQ(one, other);
}

TEST(FixedText, NumbersAtTheEdges) {
  const auto written = [](auto value) { return (FixedText<64>() << value).str(); };
  EXPECT_EQ(written(0.0), "0.000");
  EXPECT_EQ(written(0.0004), "0.000");
  EXPECT_EQ(written(0.0006), "0.001");
  EXPECT_EQ(written(-0.0996), "-0.100");
  EXPECT_EQ(written(12.3456), "12.346");
  EXPECT_EQ(written(0.9996), "1.000");
  EXPECT_EQ(written(1e15), "1000000000000000.000");
  EXPECT_EQ(written(1.1e15), ">1e15");
  EXPECT_EQ(written(-1.1e15), "->1e15");
  EXPECT_EQ(written(std::uint64_t{0}), "0");
  EXPECT_EQ(written(std::uint64_t{10}), "10");
}

TEST(FixedText, EqualityLooksAtEveryCharacterAndAtTheEnd) {
  const FixedText<8> text("abc");
  for (const char* other : {"xbc", "axc", "abx", "ab", "abcd", ""}) {
    EXPECT_NE(text, FixedText<8>(other));
    EXPECT_NE(FixedText<8>(other), text);
  }
  EXPECT_EQ(FixedText<8>(), FixedText<8>(""));
  EXPECT_TRUE(FixedText<8>().empty());
  EXPECT_FALSE(text.empty());
}

TEST(FixedText, AnIdHasAtMost63Characters) {
  EXPECT_EQ(Name(std::string(63, 'n').c_str()).str(), std::string(63, 'n'));
  EXPECT_EQ(Name(std::string(64, 'n').c_str()).str(), std::string(63, 'n'));
}

}  // namespace
}  // namespace coglab_rt
