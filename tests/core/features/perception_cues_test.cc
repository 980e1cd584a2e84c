#include "core/features/perception_cues.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "core/priors/boundaries.h"

namespace pepeseg {
namespace {

constexpr int kWidth = 120, kHeight = 100, kBorder = 60;

// Returns a view whose left half is near and red, and whose right half is far and blue, both with a
// little noise. The only mask covers the lower part of the left half; its right border is an edge
// of the depth.
Capture TwoHalves() {
  Capture capture;
  View& view = capture.views.emplace_back();
  view.name = "a.png";
  view.camera = {kWidth, kHeight, 100, 100, kWidth / 2.0, kHeight / 2.0};
  view.photo = {kWidth, kHeight, 3, {}};
  BinaryMask mask;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool left = x < kBorder;
      const auto noise = static_cast<uint8_t>((7 * x + 13 * y) % 5);
      const uint8_t red = left ? 200 : 30, blue = left ? 30 : 200;
      for (const uint8_t c : {red, uint8_t{30}, blue}) {
        view.photo.pixels.push_back(static_cast<uint8_t>(c + noise));
      }
      view.depth.values.push_back((left ? 0.8f : 0.2f) + 0.001f * static_cast<float>(noise));
      mask.pixels.push_back(left && y >= 50 ? 1 : 0);
    }
  }
  view.masks = BuildMaskSet(kWidth, kHeight, std::vector<BinaryMask>{mask});
  return capture;
}

std::vector<int> AllViews(const Capture& capture) {
  std::vector<int> all(capture.views.size());
  std::iota(all.begin(), all.end(), 0);
  return all;
}

// What PerceptionCues needs of a capture. The rendered depth is 1 everywhere.
struct Prepared {
  Prepared(Capture of, const std::vector<std::vector<float>>& mask_scales)
      : capture(std::move(of)),
        reprojection(capture, AllViews(capture)),
        views(MakeDrawableViews(capture, OwnMasks(capture), mask_scales)),
        cross_view(reprojection, views),
        edges(DepthEdges(capture.views[0])) {
    const std::vector<float> depth(kWidth * kHeight, 1.0f);
    for (const int view : reprojection.views()) reprojection.KeepDepth(view, depth);
  }
  Prepared(const Prepared&) = delete;
  Prepared& operator=(const Prepared&) = delete;

  Capture capture;
  Reprojection reprojection;
  std::vector<DrawableView> views;
  CrossView cross_view;
  std::vector<uint8_t> edges;
};

// Returns a batch of every third pixel along either axis: pixels under the mask, labelled, then the
// uncovered ones away from edges.
PixelBatch GridBatch(const Prepared& prepared) {
  PixelBatch batch;
  batch.scales = {0.1f, 1.0f, 0.5f};
  batch.scene_scales = {0.1f, 1.0f, 0.5f};
  for (const bool labelled : {true, false}) {
    for (int y = 1; y < kHeight; y += 3) {
      for (int x = 1; x < kWidth; x += 3) {
        const int32_t pixel = y * kWidth + x;
        const bool covered = prepared.capture.views[0].masks.pixel_cell[pixel] != 0;
        if (covered != labelled || (!covered && prepared.edges[pixel] != 0)) continue;
        batch.pixels.push_back(pixel);
      }
    }
    if (labelled) batch.num_labelled = static_cast<int>(batch.pixels.size());
  }
  return batch;
}

PixelBatch List(const Prepared& prepared, const FeatureOptions& options = {}) {
  PixelBatch batch = GridBatch(prepared);
  const PerceptionCues cues(prepared.capture, prepared.cross_view, prepared.views, {prepared.edges},
                            options);
  cues.List(batch);
  return batch;
}

bool IsLeft(const PixelBatch& batch, int32_t p) { return batch.pixels[p] % kWidth < kBorder; }

class PerceptionCuesTest : public ::testing::Test {
 protected:
  Prepared prepared_ = Prepared(TwoHalves(), {{0.5f}});
};

TEST_F(PerceptionCuesTest, ListsPairsWithinAHalfAsSimilarAndAcrossAsDissimilar) {
  const PixelBatch batch = List(prepared_);
  ASSERT_EQ(batch.pairs.first.size(), batch.pixels.size() + 1);
  constexpr PairCues kSimilar = 0x7;
  int num_similar = 0, num_dissimilar = 0;
  for (size_t p = 0; p < batch.pixels.size(); ++p) {
    for (int32_t e = batch.pairs.first[p]; e < batch.pairs.first[p + 1]; ++e) {
      const PairCues cues = batch.pairs.cues[e];
      const bool same =
          IsLeft(batch, static_cast<int32_t>(p)) == IsLeft(batch, batch.pairs.other[e]);
      ASSERT_NE(cues, 0u);
      ASSERT_EQ((cues & kSimilar) != 0, same);
      ASSERT_EQ((cues >> kDissimilarShift & kSimilar) != 0, !same);
      (same ? num_similar : num_dissimilar) += 1;
    }
  }
  EXPECT_GT(num_similar, 200);
  EXPECT_GT(num_dissimilar, 0);
}

TEST_F(PerceptionCuesTest, ListsPairsWithinTheRadiusAwayFromEdgesWithOneUnlabelled) {
  const PixelBatch batch = List(prepared_);
  // r(s) by the image. The mask's side of 55 px does not reduce it.
  const float radii[] = {0.042f * kHeight, 0.15f * kHeight, 0.09f * kHeight};
  for (size_t p = 0; p < batch.pixels.size(); ++p) {
    for (int32_t e = batch.pairs.first[p]; e < batch.pairs.first[p + 1]; ++e) {
      const int32_t q = batch.pairs.other[e], a = batch.pixels[p], b = batch.pixels[q];
      ASSERT_TRUE(static_cast<int>(p) >= batch.num_labelled || q >= batch.num_labelled);
      ASSERT_EQ(prepared_.edges[a], 0);
      ASSERT_EQ(prepared_.edges[b], 0);
      const auto distance =
          static_cast<float>(std::hypot(a % kWidth - b % kWidth, a / kWidth - b / kWidth));
      const PairCues cues = batch.pairs.cues[e];
      for (int k = 0; k < 3; ++k) {
        const bool counts = ((cues | cues >> kDissimilarShift) >> k & 1) != 0;
        if (counts) {
          ASSERT_LE(distance, std::max(2.0f, radii[k]));
        }
      }
    }
  }
}

TEST_F(PerceptionCuesTest, ListsEachPairUnderBothPixelsWithSharesThatAddUp) {
  const PixelBatch batch = List(prepared_);
  std::map<std::pair<int32_t, int32_t>, PairCues> pairs;
  double similar_at_1 = 0;
  for (size_t p = 0; p < batch.pixels.size(); ++p) {
    for (int32_t e = batch.pairs.first[p]; e < batch.pairs.first[p + 1]; ++e) {
      const std::pair<int32_t, int32_t> key(p, batch.pairs.other[e]);
      ASSERT_TRUE(pairs.emplace(key, batch.pairs.cues[e]).second) << "twice";
      if ((batch.pairs.cues[e] >> 1 & 1) != 0) similar_at_1 += 0.5;
    }
  }
  for (const auto& [key, cues] : pairs) ASSERT_EQ(pairs.at({key.second, key.first}), cues);
  EXPECT_NEAR(batch.pairs.share[1] * similar_at_1, 1.0 / 3, 1e-6);
}

TEST_F(PerceptionCuesTest, ListsNoPairsWithoutUnlabelledPixels) {
  PixelBatch batch = GridBatch(prepared_);
  batch.pixels.resize(batch.num_labelled);
  const PerceptionCues cues(prepared_.capture, prepared_.cross_view, prepared_.views,
                            {prepared_.edges}, {});
  cues.List(batch);
  EXPECT_TRUE(batch.pairs.other.empty());
  for (const float share : batch.pairs.share) EXPECT_EQ(share, 0);
}

TEST_F(PerceptionCuesTest, ListsPairsInAWindowByTheScaleAlone) {
  // min(H, W) (0.03 + 0.12 s) is at most 15 pixels here: the lower bound of 20 counts.
  const PixelBatch batch = List(prepared_, {.perception_fit_window = false});
  double farthest = 0;
  for (size_t p = 0; p < batch.pixels.size(); ++p) {
    for (int32_t e = batch.pairs.first[p]; e < batch.pairs.first[p + 1]; ++e) {
      const int32_t a = batch.pixels[p], b = batch.pixels[batch.pairs.other[e]];
      farthest = std::max(farthest, std::hypot(a % kWidth - b % kWidth, a / kWidth - b / kWidth));
    }
  }
  EXPECT_GT(farthest, 15);
  EXPECT_LE(farthest, 20);
}

// The mask of TwoHalves is cut in two, which depth and colour do not show.
TEST_F(PerceptionCuesTest, ListsLabelledPairsWhereMasksAgreeWithTheCue) {
  constexpr int kCut = 75;
  Capture capture = TwoHalves();
  BinaryMask halves[2];
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const bool covered = i % kWidth < kBorder && i / kWidth >= 50;
    halves[0].pixels.push_back(covered && i / kWidth < kCut ? 1 : 0);
    halves[1].pixels.push_back(covered && i / kWidth >= kCut ? 1 : 0);
  }
  capture.views[0].masks = BuildMaskSet(kWidth, kHeight, halves);
  const Prepared prepared(std::move(capture), {{0.5f, 0.5f}});
  PixelBatch batch = GridBatch(prepared);
  const auto is_lower = [&](int32_t p) { return batch.pixels[p] / kWidth >= kCut; };
  for (int p = 0; p < batch.num_labelled; ++p) batch.cell.push_back(is_lower(p) ? 1 : 0);
  batch.num_cells = 2;
  for (size_t scale = 0; scale < batch.scales.size(); ++scale) {
    batch.labels.insert(batch.labels.end(), {1, 2});  // a mask each
  }
  const auto num_labelled_pairs = [&](const FeatureOptions& options) {
    PixelBatch listed = batch;
    PerceptionCues(prepared.capture, prepared.cross_view, prepared.views, {prepared.edges}, options)
        .List(listed);
    int num = 0;
    for (int32_t p = 0; p < batch.num_labelled; ++p) {
      for (int32_t e = listed.pairs.first[p]; e < listed.pairs.first[p + 1]; ++e) {
        const int32_t q = listed.pairs.other[e];
        if (q >= batch.num_labelled) continue;
        EXPECT_EQ(is_lower(p), is_lower(q));
        ++num;
      }
    }
    return num;
  };
  EXPECT_EQ(num_labelled_pairs({}), 0);
  EXPECT_GT(num_labelled_pairs({.perception_unlabelled_only = false}), 200);
}

// On a slope along x all gradients are equal, so a difference along x of more than a pixel is over
// them, and one along y is not.
TEST_F(PerceptionCuesTest, ComparesWithTheGradientsOfTheWholeWindow) {
  Capture capture = TwoHalves();
  View& view = capture.views[0];
  for (int i = 0; i < kWidth * kHeight; ++i) {
    view.depth.values[i] = 0.002f * static_cast<float>(i % kWidth);
    for (int c = 0; c < 3; ++c)
      view.photo.pixels[3 * i + c] = static_cast<uint8_t>(2 * (i % kWidth));
  }
  const Prepared prepared(std::move(capture), {{0.5f}});
  const PixelBatch batch = List(prepared, {.perception_threshold = PerceptionThreshold::kWindows,
                                           .perception_depth_floor = 0,
                                           .perception_color_floor = 0});
  int num_similar = 0, num_dissimilar = 0;
  for (size_t p = 0; p < batch.pixels.size(); ++p) {
    for (int32_t e = batch.pairs.first[p]; e < batch.pairs.first[p + 1]; ++e) {
      const int32_t a = batch.pixels[p], b = batch.pixels[batch.pairs.other[e]];
      const bool similar = (batch.pairs.cues[e] & 0x7) != 0;
      ASSERT_EQ(similar, a % kWidth == b % kWidth);
      (similar ? num_similar : num_dissimilar) += 1;
    }
  }
  EXPECT_GT(num_similar, 200);
  EXPECT_GT(num_dissimilar, 200);
}

TEST_F(PerceptionCuesTest, CallsEvenSurroundingsDissimilarWithoutFloors) {
  Capture capture = TwoHalves();
  std::ranges::fill(capture.views[0].depth.values, 0.5f);
  std::ranges::fill(capture.views[0].photo.pixels, uint8_t{90});
  const Prepared prepared(std::move(capture), {{0.5f}});
  const auto num_dissimilar = [&](const FeatureOptions& options) {
    return std::ranges::count_if(List(prepared, options).pairs.cues,
                                 [](PairCues cues) { return cues >> kDissimilarShift != 0; });
  };
  EXPECT_EQ(num_dissimilar({}), 0);
  EXPECT_GT(num_dissimilar({.perception_depth_floor = 0, .perception_color_floor = 0}), 100);
}

// Both halves have one depth and one colour; only the masks of another view tell them apart.
TEST_F(PerceptionCuesTest, DropsSimilarPairsThatMasksOfOtherViewsKeepApart) {
  Capture capture = TwoHalves();
  View& view = capture.views[0];
  std::fill(view.depth.values.begin(), view.depth.values.end(), 0.5f);
  std::fill(view.photo.pixels.begin(), view.photo.pixels.end(), uint8_t{90});
  capture.views.push_back(view);
  capture.views[1].name = "b.png";
  BinaryMask halves[2];
  for (int i = 0; i < kWidth * kHeight; ++i) {
    halves[0].pixels.push_back(i % kWidth < kBorder ? 1 : 0);
    halves[1].pixels.push_back(i % kWidth < kBorder ? 0 : 1);
  }
  capture.views[1].masks = BuildMaskSet(kWidth, kHeight, halves);
  const Prepared prepared(std::move(capture), {{0.5f}, {0.5f, 0.6f}});
  const auto count_across = [&](const FeatureOptions& options) {
    const PixelBatch batch = List(prepared, options);
    int across = 0;
    for (size_t p = 0; p < batch.pixels.size(); ++p) {
      for (int32_t e = batch.pairs.first[p]; e < batch.pairs.first[p + 1]; ++e) {
        across += IsLeft(batch, static_cast<int32_t>(p)) != IsLeft(batch, batch.pairs.other[e]);
      }
    }
    EXPECT_GT(batch.pairs.other.size(), 100u);
    return across;
  };
  EXPECT_EQ(count_across({}), 0);
  EXPECT_GT(count_across({.perception_cross_view = false}), 10);
}

}  // namespace
}  // namespace pepeseg
