#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/features/batch_drawer.h"
#include "core/features/near_views.h"
#include "core/features/options.h"
#include "core/scene/capture.h"
#include "kernels/ops/feature.h"

namespace pepeseg {

// Lists the pairs of pixels for the perception loss (METHOD.md section 3, "Perception loss"), with
// what colour and depth indicate about them. At scale s a pair counts if its pixels are within r(s)
// of each other and away from the edges of the depth prior, and at least one of them is unlabelled
// (without FeatureOptions::perception_unlabelled_only, which the paper does not do: or their masks
// agree with the cue).
// A pair is similar if both its depth and its colour differ less than the thresholds of its two
// pixels, and dissimilar if both differ at least by them.
//
// With FeatureOptions::perception_cross_view the masks of near views overrule this: a pair that
// they keep apart is not similar, and a pair that they put together is not dissimilar.
class PerceptionCues {
 public:
  // edges: DepthEdges of the views with unlabelled pixels, by view of the capture. All arguments
  // but the edges and the options must outlive it.
  PerceptionCues(const Capture& capture, const CrossView& cross_view,
                 const std::vector<DrawableView>& views, std::vector<std::vector<uint8_t>> edges,
                 const FeatureOptions& options);

  // Fills in the pairs of a batch. Thread safe.
  void List(PixelBatch& batch) const;

 private:
  // Thresholds of one pixel at each scale of the batch: differences below them are usual in the
  // pixel's surroundings. depth: units of the prior, which has the range [0, 1]. color: 1 is the
  // difference of one channel from black to white.
  struct Usual {
    std::array<float, kMaxScales> depth, color;
  };
  struct Pair {
    int32_t p, q;  // indices into PixelBatch::pixels
    PairCues cues;
  };
  class Judge;  // computes the cues of the pairs of one batch

  // Returns r(s) at each scale of the batch, pixels.
  std::vector<float> Radii(const PixelBatch& batch) const;
  // Returns the arrays of PerceptionLossArgs, with each pair under both of its pixels.
  static PairLists ListsOf(std::span<const Pair> pairs, size_t num_pixels, size_t num_scales);
  // Returns up to about 16 pairs of each pixel that starts pairs, all within `radius` pixels,
  // without cues.
  std::vector<Pair> NearPairs(const PixelBatch& batch, float radius) const;

  const Capture& capture_;
  const CrossView& cross_view_;
  std::vector<std::vector<uint8_t>> edges_;  // by view of the capture
  // By view of the capture: the scale (scene units) and the side (square root of the area, pixels)
  // of each mask with a scale, ascending.
  std::vector<std::vector<std::pair<float, float>>> mask_sides_;
  PerceptionThreshold threshold_;
  float depth_floor_, color_floor_;  // lower bounds of the thresholds
  bool fit_window_, unlabelled_only_, ask_other_views_;
};

}  // namespace pepeseg
