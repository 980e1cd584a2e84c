#include "core/annotations/id_counts.h"

#include <gtest/gtest.h>

#include <random>

#include "core/annotations/things.h"
#include "core/formats/rle.h"

namespace pepeseg {
namespace {

TEST(CountsOfIds, AreThoseOfTheMaskOfEachId) {
  std::mt19937 random(3);
  for (const RasterSize& size : {RasterSize{1, 1}, {7, 5}, {40, 30}}) {
    std::vector<int32_t> ids(static_cast<size_t>(size.width) * size.height);
    // 0 and 5 are in no mask; 4 has no pixels.
    for (int32_t& id : ids) id = static_cast<int32_t>((random() % 6) % 5 + (random() % 9 == 0));
    for (int32_t& id : ids) id = id == 4 ? 3 : id;
    const std::vector<std::string> counts = CountsOfIds(ids, 4, size);
    ASSERT_EQ(counts.size(), 4U);
    for (int32_t id = 1; id <= 4; ++id) {
      BinaryMask mask;
      for (const int32_t of_pixel : ids) mask.pixels.push_back(of_pixel == id ? 1 : 0);
      EXPECT_EQ(counts[static_cast<size_t>(id) - 1], EncodeCocoRle(mask, size.width, size.height));
    }
    EXPECT_TRUE(ShowNothing(counts[3], size));
  }
}

}  // namespace
}  // namespace pepeseg
