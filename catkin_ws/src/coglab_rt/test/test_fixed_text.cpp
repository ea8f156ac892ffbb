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

}  // namespace
}  // namespace coglab_rt
