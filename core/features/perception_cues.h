#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/features/batch_drawer.h"
#include "core/features/cross_view.h"
#include "core/features/train_features.h"
#include "core/scene/capture.h"
#include "kernels/ops/perception.h"

namespace pepeseg {

// What colour and depth say of pixels that masks leave open (METHOD.md section 3, "Perception
// loss"). At scale s, two pixels count that are within r(s) of each other, away from the edges of
// the depth prior, one of them under no mask in this view. They are similar where both their depth
// and their colour differ less than is usual about them, dissimilar where both differ at least so.
// Unless the options say otherwise, other views' masks have the last word: what they keep apart is
// not similar, what they put together is not dissimilar.
class PerceptionCues {
 public:
  // edges: DepthEdges of each view of the capture that is drawn. All must outlive it but the edges.
  PerceptionCues(const Capture& capture, const CrossView& cross_view,
                 const std::vector<DrawableView>& views, std::vector<std::vector<uint8_t>> edges,
                 const FeatureOptions& options);

  // Fills in the batch's pairs. Thread safe.
  void List(PixelBatch& batch) const;

 private:
  // Over which differences are not usual about a pixel, at each scale of the batch.
  struct Usual {
    std::array<float, kMaxScales> depth, color;
  };
  struct Pair {
    int32_t p, q;  // of the batch
    PairCues cues;
  };
  class Judge;  // of one batch's pairs

  std::vector<float> Radii(const PixelBatch& batch) const;
  // Both ways round, by pixel.
  static PairLists ListsOf(std::span<const Pair> pairs, size_t num_pixels, size_t num_scales);
  std::vector<Pair> NearPairs(const PixelBatch& batch, float radius) const;
  Usual UsualAbout(const PixelBatch& batch, int32_t pixel, std::span<const float> radii) const;

  const Capture& capture_;
  const CrossView& cross_view_;
  std::vector<std::vector<uint8_t>> edges_;  // by view of the capture
  // By view of the capture: scale and side, pixels, of each mask with a scale, by scale.
  std::vector<std::vector<std::pair<float, float>>> mask_sides_;
  PerceptionThreshold threshold_;
  bool ask_other_views_;
};

}  // namespace pepeseg
