#include "core/priors/embedded_masks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <utility>

#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

struct Rgb {
  uint8_t r, g, b;
};

// Returns a view whose photograph has `color` at each pixel.
View Photographed(int width, int height, const std::function<Rgb(int x, int y)>& color) {
  View view;
  view.camera = {width, height, 100, 100, width / 2.0, height / 2.0};
  view.photo = {width, height, 3, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Rgb rgb = color(x, y);
      view.photo.pixels.insert(view.photo.pixels.end(), {rgb.r, rgb.g, rgb.b});
    }
  }
  return view;
}

// Returns the best IoU of any mask with the pixels for which `inside` is true.
double BestIou(const MaskSet& masks, const std::function<bool(int x, int y)>& inside) {
  double best = 0;
  for (int k = 0; k < masks.num_masks; ++k) {
    double both = 0, either = 0;
    const BinaryMask mask = masks.Extract(k);
    for (int y = 0; y < masks.height; ++y) {
      for (int x = 0; x < masks.width; ++x) {
        const bool in_mask = mask.pixels[static_cast<size_t>(y) * masks.width + x] != 0;
        both += in_mask && inside(x, y) ? 1 : 0;
        either += in_mask || inside(x, y) ? 1 : 0;
      }
    }
    best = std::max(best, both / either);
  }
  return best;
}

bool IsPart(int x, int y) { return x >= 50 && x < 80 && y >= 40 && y < 70; }
bool IsObject(int x, int y) { return x >= 40 && x < 120 && y >= 30 && y < 90; }

Rgb PartInObject(int x, int y) {
  const auto noise = static_cast<uint8_t>((x * 7 + y * 13) % 9);
  if (IsPart(x, y)) return {static_cast<uint8_t>(190 + noise), 40, 40};
  if (IsObject(x, y)) return {static_cast<uint8_t>(190 + noise), 90, 40};
  return {60, 90, static_cast<uint8_t>(160 + noise)};
}

TEST(EmbeddedMasks, FindAPartAndTheObjectAroundIt) {
  const View view = Photographed(160, 120, PartInObject);
  const MaskSet masks = EmbeddedMasks(view).masks;
  EXPECT_GT(BestIou(masks, IsPart), 0.85);
  EXPECT_GT(BestIou(masks, IsObject), 0.9);
  EXPECT_EQ(masks.width, 160);
  EXPECT_EQ(masks.height, 120);
}

TEST(EmbeddedMasks, FindTheSameObjectsInALargePhotograph) {
  const View view =
      Photographed(1600, 1200, [](int x, int y) { return PartInObject(x / 10, y / 10); });
  const MaskSet masks = EmbeddedMasks(view).masks;
  EXPECT_EQ(masks.width, 1600);
  EXPECT_GT(BestIou(masks, [](int x, int y) { return IsObject(x / 10, y / 10); }), 0.9);
}

TEST(EmbeddedMasks, LeaveOutIgnoredPixels) {
  View view = Photographed(160, 120, PartInObject);
  view.ignore.assign(160 * 120, 0);
  for (int y = 30; y < 90; ++y) std::fill_n(&view.ignore[y * 160 + 100], 20, uint8_t{1});
  const MaskSet masks = EmbeddedMasks(view).masks;
  ASSERT_FALSE(masks.empty());
  for (size_t i = 0; i < view.ignore.size(); ++i) {
    if (view.ignore[i] != 0) {
      ASSERT_EQ(masks.pixel_cell[i], 0u);
    }
  }
  EXPECT_GT(BestIou(masks, [](int x, int y) { return IsObject(x, y) && x < 100; }), 0.85);
}

TEST(EmbeddedMasks, FollowDepthEdgesWhereColourIsUniform) {
  View view = Photographed(160, 120, [](int x, int y) {
    return Rgb{120, static_cast<uint8_t>(110 + (x * 5 + y * 3) % 7), 100};
  });
  EXPECT_LT(BestIou(EmbeddedMasks(view).masks, IsObject), 0.5);
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) view.depth.values.push_back(IsObject(x, y) ? 0.2f : 0.8f);
  }
  EXPECT_GT(BestIou(EmbeddedMasks(view).masks, IsObject), 0.85);
}

TEST(EmbeddedMasks, AreEmptyForAUniformPhotograph) {
  for (const auto& [width, height] : {std::pair{64, 48}, {1, 1}}) {
    const View view = Photographed(width, height, [](int, int) { return Rgb{9, 9, 9}; });
    EXPECT_TRUE(EmbeddedMasks(view).masks.empty());
  }
}

TEST(EmbeddedMasks, KeepTheBestUpToTheLimit) {
  const View view = Photographed(160, 120, PartInObject);
  const EmbeddedMaskSet two = EmbeddedMasks(view, 2);
  EXPECT_LE(two.masks.num_masks, 2);
  EXPECT_GT(BestIou(two.masks, IsObject), 0.9);  // the best first
}

TEST(EmbeddedMasks, AreSortedByQuality) {
  const EmbeddedMaskSet made = EmbeddedMasks(Photographed(160, 120, PartInObject));
  ASSERT_EQ(made.quality.size(), static_cast<size_t>(made.masks.num_masks));
  EXPECT_TRUE(std::is_sorted(made.quality.rbegin(), made.quality.rend()));
  EXPECT_GT(made.quality.back(), 0);
  EXPECT_LE(made.quality.front(), 1);
}

TEST(EmbeddedMasks, FindTheObjectsOfATexturedScene) {
  const testing::SyntheticScene scene =
      testing::MakeSyntheticScene({.num_views = 3, .width = 240, .height = 180});
  for (size_t i = 0; i < scene.capture.views.size(); ++i) {
    const MaskSet masks = EmbeddedMasks(scene.capture.views[i]).masks;
    for (int label = 1; label <= testing::kNumObjects; ++label) {
      const auto inside = [&](int x, int y) { return scene.labels[i][y * 240 + x] == label; };
      EXPECT_GT(BestIou(masks, inside), 0.7) << "view " << i << ", object " << label;
    }
  }
}

}  // namespace
}  // namespace pepeseg
