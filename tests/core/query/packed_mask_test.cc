#include "core/query/packed_mask.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace pepeseg {
namespace {

TEST(UnpackMaskTest, GivesAByteForEachBit) {
  for (const size_t num_pixels : {1, 7, 8, 9, 32, 33, 200}) {
    std::vector<uint32_t> bits((num_pixels + 31) / 32);
    std::vector<uint8_t> want(num_pixels);
    for (size_t i = 0; i < num_pixels; ++i) {
      want[i] = (i * i + i / 3) % 3 == 0 ? 1 : 0;
      bits[i / 32] |= uint32_t{want[i]} << (i % 32);
    }
    std::vector<uint8_t> mask(num_pixels, 9);
    UnpackMask(bits, mask);
    EXPECT_EQ(mask, want) << num_pixels;
  }
}

TEST(UnpackMaskTest, TakesAnEmptyMask) {
  std::vector<uint8_t> mask;
  UnpackMask({}, mask);
  EXPECT_TRUE(mask.empty());
}

}  // namespace
}  // namespace pepeseg
