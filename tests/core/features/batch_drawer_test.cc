#include "core/features/batch_drawer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <map>
#include <optional>

#include "core/features/mask_scales.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

// A drawer over the synthetic scene. Mask m of view i has the scale 0.3 + 0.2 m + 0.01 i; part of
// view 3 is ignored.
struct Drawn {
  explicit Drawn(const FeatureOptions& options)
      : capture(testing::MakeSyntheticScene().capture), scales(capture.views.size()) {
    std::vector<float> all;
    for (size_t i = 0; i < scales.size(); ++i) {
      for (int mask = 0; mask < capture.views[i].masks.num_masks; ++mask) {
        scales[i].push_back(0.3f + 0.2f * static_cast<float>(mask) + 0.01f * static_cast<float>(i));
      }
      all.insert(all.end(), scales[i].begin(), scales[i].end());
    }
    field.scale_quantiles = ScaleQuantiles(all);
    capture.views[3].ignore.assign(capture.views[3].masks.pixel_cell.size(), 0);
    for (size_t i = 0; i < 3000; ++i) capture.views[3].ignore[i] = 1;
    views = MakeDrawableViews(capture, OwnMasks(capture), scales);
    drawer.emplace(field, views, options);
  }
  Capture capture;
  std::vector<std::vector<float>> scales;
  FeatureField field;
  std::vector<DrawableView> views;
  std::optional<BatchDrawer> drawer;
};

TEST(BatchDrawer, DrawsEachTrainingViewOncePerRound) {
  Drawn drawn({.num_pixels = 10});
  int num_training = 0;
  for (const View& view : drawn.capture.views) num_training += view.held_out ? 0 : 1;
  for (int round = 0; round < 3; ++round) {
    std::map<int, int> times;
    for (int i = 0; i < num_training; ++i) ++times[drawn.drawer->Draw(drawn.drawer->Next()).view];
    EXPECT_EQ(times.size(), static_cast<size_t>(num_training));
    for (const auto& [view, count] : times) EXPECT_FALSE(drawn.capture.views[view].held_out);
  }
}

// 10 steps a chunk leave time for two visits of each of the subset's views.
TEST(BatchDrawer, DrawsAChunkFromViewsAtEvenDistances) {
  const FeatureOptions options = {.num_pixels = 4, .steps_per_chunk = 10, .views_per_chunk = 5};
  Drawn drawn(options);
  const int num_views = static_cast<int>(drawn.views.size());
  const int num_subsets = (num_views + 4) / 5;
  ASSERT_GT(num_subsets, 1);
  std::map<int, int> times;
  for (int round = 0; round < 2; ++round) {
    for (int subset = 0; subset < num_subsets; ++subset) {
      const int num_steps = drawn.drawer->NumAlike();
      std::map<int, int> of_chunk;
      for (int step = 0; step < num_steps; ++step) {
        EXPECT_EQ(drawn.drawer->NumAlike(), num_steps - step);
        const int view = drawn.drawer->Next().view;
        ++of_chunk[view];
        ++times[view];
      }
      EXPECT_LE(of_chunk.size(), 5u);
      const int first = of_chunk.begin()->first;
      for (const auto& [view, count] : of_chunk) {
        EXPECT_EQ(count, num_steps / static_cast<int>(of_chunk.size())) << view;
        EXPECT_TRUE(view % num_subsets == first % num_subsets || view < num_subsets) << view;
      }
    }
  }
  EXPECT_EQ(times.size(), static_cast<size_t>(num_views));
}

TEST(BatchDrawer, DrawsTheSameAfterARestoreWithinASubset) {
  const FeatureOptions options = {.num_pixels = 4, .steps_per_chunk = 10, .views_per_chunk = 5};
  Drawn unbroken(options), resumed(options);
  for (int step = 0; step < 13; ++step) unbroken.drawer->Next();
  ASSERT_OK(resumed.drawer->Restore(unbroken.drawer->Save(), 13));
  EXPECT_EQ(unbroken.drawer->NumAlike(), resumed.drawer->NumAlike());
  for (int step = 13; step < 80; ++step) {
    const BatchDrawer::Draft a = unbroken.drawer->Next(), b = resumed.drawer->Next();
    EXPECT_EQ(a.view, b.view);
    EXPECT_EQ(a.seed, b.seed);
  }
}

TEST(BatchDrawer, DrawsOnlyPixelsUnderMasksThatAreNotIgnored) {
  Drawn drawn({.num_pixels = 200});
  for (int i = 0; i < 24; ++i) {
    const PixelBatch batch = drawn.drawer->Draw(drawn.drawer->Next());
    const View& view = drawn.capture.views[batch.view];
    ASSERT_EQ(batch.pixels.size(), 200u);
    for (const int32_t pixel : batch.pixels) {
      EXPECT_NE(view.masks.pixel_cell[pixel], 0u);
      EXPECT_TRUE(view.ignore.empty() || view.ignore[pixel] == 0);
    }
  }
}

TEST(BatchDrawer, DrawsSmallMasksMoreOftenWithAMaskShare) {
  Drawn by_pixel({.num_pixels = 300, .mask_share = 0}),
      by_mask({.num_pixels = 300, .mask_share = 1});
  const auto share_of_smallest = [](Drawn& drawn) {
    double inside = 0, all = 0;
    for (int i = 0; i < 40; ++i) {
      const PixelBatch batch = drawn.drawer->Draw(drawn.drawer->Next());
      const MaskSet& masks = drawn.capture.views[batch.view].masks;
      const auto smallest =
          static_cast<int>(std::min_element(masks.mask_area.begin(), masks.mask_area.end()) -
                           masks.mask_area.begin());
      for (const int32_t pixel : batch.pixels) {
        inside += masks.Covers(smallest, pixel % masks.width, pixel / masks.width) ? 1 : 0;
      }
      all += static_cast<double>(batch.pixels.size());
    }
    return inside / all;
  };
  EXPECT_GT(share_of_smallest(by_mask), 1.3 * share_of_smallest(by_pixel));
}

TEST(BatchDrawer, WeighsPixelsByTheAreaOfTheirMasks) {
  Drawn drawn({.num_pixels = 50});
  const PixelBatch batch = drawn.drawer->Draw(drawn.drawer->Next());
  const MaskSet& masks = drawn.capture.views[batch.view].masks;
  for (size_t i = 0; i < batch.pixels.size(); ++i) {
    double area = 0, count = 0;
    for (int mask = 0; mask < masks.num_masks; ++mask) {
      if (!masks.Covers(mask, batch.pixels[i] % masks.width, batch.pixels[i] / masks.width)) {
        continue;
      }
      area += static_cast<double>(masks.mask_area[mask]);
      ++count;
    }
    EXPECT_NEAR(batch.weight[i], count / area, 1e-6 * count / area);
  }
}

TEST(BatchDrawer, DrawsScalesFromBelowTheSmallestMaskToBeyondTheLargest) {
  Drawn drawn({.num_pixels = 4, .num_scales = 10});
  for (int i = 0; i < 50; ++i) {
    const PixelBatch batch = drawn.drawer->Draw(drawn.drawer->Next());
    ASSERT_EQ(batch.scales.size(), 10u);
    for (const float scale : batch.scales) {
      EXPECT_GE(scale, 0);
      EXPECT_LE(scale, 1);
    }
    // The last scale is below the smallest mask of the view.
    const double smallest = QuantileOfScale(drawn.field, 0.3 + 0.01 * batch.view + 1e-6);
    EXPECT_LE(batch.scales.back(), smallest + 1e-6);
    EXPECT_EQ(batch.labels.size(),
              size_t{10} * batch.num_cells * static_cast<size_t>(batch.label_words));
  }
}

TEST(BatchDrawer, DrawsTheScalesOfFineMasksFirst) {
  Drawn drawn({.num_steps = 100, .num_pixels = 4, .fine_first = 0.5});
  int num_beyond = 0;
  for (int step = 0; step < 100; ++step) {
    const PixelBatch batch = drawn.drawer->Draw(drawn.drawer->Next());
    const std::vector<float>& scales = drawn.scales[batch.view];
    const float highest = *std::ranges::max_element(batch.scene_scales);
    // After a third of the fine steps 53 % of the masks take part, rounded up: not yet the largest.
    if (step < 17) {
      EXPECT_LE(highest, scales[scales.size() - 2]) << step;
    }
    if (step >= 50) num_beyond += highest > scales.back() ? 1 : 0;
  }
  // One scale of each batch is drawn from beyond the second largest mask.
  EXPECT_GT(num_beyond, 25);
}

TEST(BatchDrawer, DrawsNoNeighborsAfterTheEndOfSmoothing) {
  Drawn drawn({.num_steps = 10, .num_neighbors = 8, .num_drawn_neighbors = 3, .smooth_until = 0.4});
  for (int step = 0; step < 4; ++step) {
    EXPECT_EQ(drawn.drawer->NumAlike(), 4 - step);
    EXPECT_EQ(std::popcount(drawn.drawer->Draw(drawn.drawer->Next()).drawn_neighbors), 3);
  }
  for (int step = 4; step < 10; ++step) {
    EXPECT_GE(drawn.drawer->NumAlike(), 10 - step);
    EXPECT_EQ(drawn.drawer->Draw(drawn.drawer->Next()).drawn_neighbors, 1u)
        << "the Gaussian itself";
  }
}

TEST(BatchDrawer, DrawsTheSameAfterARestoreWhileFineMasksGoFirst) {
  const FeatureOptions options = {.num_steps = 40, .num_pixels = 4, .fine_first = 0.9};
  Drawn unbroken(options), resumed(options);
  for (int step = 0; step < 20; ++step) unbroken.drawer->Next();
  ASSERT_OK(resumed.drawer->Restore(unbroken.drawer->Save(), 20));
  for (int step = 20; step < 40; ++step) {
    EXPECT_EQ(unbroken.drawer->Draw(unbroken.drawer->Next()).scene_scales,
              resumed.drawer->Draw(resumed.drawer->Next()).scene_scales);
  }
}

TEST(BatchDrawer, DependsOnItsSeedAlone) {
  Drawn a({.num_pixels = 30, .seed = 5}), b({.num_pixels = 30, .seed = 5});
  Drawn c({.num_pixels = 30, .seed = 6});
  bool differs = false;
  for (int i = 0; i < 5; ++i) {
    const PixelBatch x = a.drawer->Draw(a.drawer->Next()), y = b.drawer->Draw(b.drawer->Next()),
                     z = c.drawer->Draw(c.drawer->Next());
    EXPECT_EQ(x.pixels, y.pixels);
    EXPECT_EQ(x.scales, y.scales);
    EXPECT_EQ(x.pair_seed, y.pair_seed);
    differs |= x.pixels != z.pixels;
  }
  EXPECT_TRUE(differs);
}

TEST(MakeDrawableViews, LeavesOutViewsWithoutAScaledMask) {
  const Capture capture = testing::MakeSyntheticScene().capture;
  std::vector<std::vector<float>> scales;
  for (const View& view : capture.views) scales.emplace_back(view.masks.num_masks, kNoScale);
  EXPECT_TRUE(MakeDrawableViews(capture, OwnMasks(capture), scales).empty());
}

}  // namespace
}  // namespace pepeseg
