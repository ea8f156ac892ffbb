/// Codes and texts that are composed without allocation.
#include <gtest/gtest.h>

#include <cmath>
#include <iterator>
#include <limits>
#include <random>
#include <set>
#include <string>

#include "coglab_rt/fixed_text.hpp"
#include "coglab_rt/reason.hpp"

namespace coglab_rt {
namespace {

TEST(Reason, EveryBlockHasWordsACodeOfItsOwnAndTheWayBack) {
  std::set<std::uint16_t> seen;
  for (int i = 0; i < 256; ++i) {
    const auto block = static_cast<MotionBlock>(i);
    if (std::string(describe(block)) == "?") continue;  // no value of the enum
    const auto code = static_cast<std::uint16_t>(codeOf(block));
    EXPECT_EQ(code == 0, block == MotionBlock::None) << describe(block);
    EXPECT_TRUE(seen.insert(code).second) << describe(block);
    EXPECT_EQ(motionBlockOf(code), block) << describe(block);
  }
  EXPECT_EQ(seen.size(), std::size(kBlockCodes));
  EXPECT_EQ(motionBlockOf(12345), MotionBlock::NotStarted);
}

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

}  // namespace
}  // namespace coglab_rt
