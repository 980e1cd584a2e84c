#include "core/scene/gaussians.h"

#include <gtest/gtest.h>

#include <vector>

namespace pepeseg {
namespace {

TEST(Gaussians, SelectReturnsTheIndexedGaussiansInOrder) {
  Gaussians gaussians = Gaussians::Zero(4, 1);
  ASSERT_EQ(gaussians.planes.size(), 4u * NumPlanes(1));
  for (int k = 0; k < NumPlanes(1); ++k) {
    for (int i = 0; i < 4; ++i) gaussians.Plane(k)[i] = static_cast<float>(10 * k + i);
  }
  const std::vector<int64_t> rows = {3, 0, 3};
  const Gaussians selected = gaussians.Select(rows);
  ASSERT_EQ(selected.count, 3);
  ASSERT_EQ(selected.sh_degree, 1);
  for (int k = 0; k < NumPlanes(1); ++k) {
    EXPECT_EQ(selected.Plane(k)[0], 10 * k + 3);
    EXPECT_EQ(selected.Plane(k)[1], 10 * k);
    EXPECT_EQ(selected.Plane(k)[2], 10 * k + 3);
  }
}

}  // namespace
}  // namespace pepeseg
