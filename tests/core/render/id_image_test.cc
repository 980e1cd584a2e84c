#include "core/render/id_image.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

struct Entry {
  int32_t gaussian;
  float weight;
};

// Renders ids of a view in which all pixels show the same entries.
absl::StatusOr<std::vector<int32_t>> Show(const std::vector<Entry>& entries,
                                          const std::vector<int32_t>& ids, int width = 1,
                                          int height = 1) {
  ModelView view;
  view.camera.width = width;
  view.camera.height = height;
  return RenderIds(view, ids, [&](const ModelView&, std::span<const int32_t> pixels) {
    PixelRows rows;
    rows.first = {0};
    for (size_t i = 0; i < pixels.size(); ++i) {
      for (const Entry& entry : entries) {
        rows.gaussian.push_back(entry.gaussian);
        rows.weight.push_back(entry.weight);
      }
      rows.first.push_back(static_cast<int32_t>(rows.gaussian.size()));
    }
    return absl::StatusOr<PixelRows>(rows);
  });
}

TEST(RenderIds, ReturnsTheIdWithTheLargestSumOfWeights) {
  const std::vector<int32_t> ids = {4, 2, 2, 0};
  ASSERT_OK_AND_ASSIGN(const auto image, Show({{0, 0.35f}, {1, 0.2f}, {2, 0.2f}, {3, 0.2f}}, ids));
  EXPECT_EQ(image, std::vector<int32_t>{2});
  ASSERT_OK_AND_ASSIGN(const auto other, Show({{0, 0.45f}, {1, 0.2f}, {2, 0.2f}}, ids));
  EXPECT_EQ(other, std::vector<int32_t>{4});
  ASSERT_OK_AND_ASSIGN(const auto equal, Show({{0, 0.25f}, {1, 0.25f}}, ids));
  EXPECT_EQ(equal, std::vector<int32_t>{2});
}

TEST(RenderIds, ReturnsZeroWithLittleWeightOrInNoSegment) {
  const std::vector<int32_t> ids = {4, 0};
  ASSERT_OK_AND_ASSIGN(const auto faint, Show({{0, 0.49f}}, ids));
  EXPECT_EQ(faint, std::vector<int32_t>{0});
  ASSERT_OK_AND_ASSIGN(const auto unassigned, Show({{0, 0.3f}, {1, 0.4f}}, ids));
  EXPECT_EQ(unassigned, std::vector<int32_t>{0});
  ASSERT_OK_AND_ASSIGN(const auto empty, Show({}, ids));
  EXPECT_EQ(empty, std::vector<int32_t>{0});
}

TEST(RenderIds, RendersLargeViewsInBands) {
  constexpr int kWidth = 900, kHeight = 700;
  ModelView view;
  view.camera.width = kWidth;
  view.camera.height = kHeight;
  const std::vector<int32_t> ids = {1, 2};
  int num_bands = 0;
  // The left half shows Gaussian 0, the right half 1.
  const auto rows = [&](const ModelView&, std::span<const int32_t> pixels) {
    ++num_bands;
    PixelRows band;
    band.first = {0};
    for (const int32_t pixel : pixels) {
      band.gaussian.push_back(pixel % kWidth < kWidth / 2 ? 0 : 1);
      band.weight.push_back(1);
      band.first.push_back(static_cast<int32_t>(band.gaussian.size()));
    }
    return absl::StatusOr<PixelRows>(band);
  };
  ASSERT_OK_AND_ASSIGN(const auto image, RenderIds(view, ids, rows));
  EXPECT_GT(num_bands, 1);
  ASSERT_EQ(image.size(), size_t{kWidth} * kHeight);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    ASSERT_EQ(image[i], i % kWidth < kWidth / 2 ? 1 : 2) << i;
  }
}

}  // namespace
}  // namespace pepeseg
