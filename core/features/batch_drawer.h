#pragma once

#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/features/feature_checkpoint.h"
#include "core/features/pixels_by_mask.h"
#include "core/features/train_features.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"

namespace pepeseg {

// Pairs of a batch's pixels for PerceptionLoss, which says more of each.
struct PairLists {
  std::vector<int32_t> first = {}, other = {};
  std::vector<uint32_t> cues = {};
  std::vector<float> share = {};
};

// The samples of one step: nothing here depends on a feature.
struct PixelBatch {
  int view = 0;  // index in the capture
  // [S] y * width + x: the labelled ones, each under a mask that has a scale; of the background,
  // which is labelled, too; of what no mask covers in this view.
  std::vector<int32_t> pixels;
  int num_labelled = 0;
  std::vector<float> weight;   // [labelled] 1 / mean area of the masks over the pixel
  std::vector<int32_t> patch;  // [labelled] -> patches of this batch
  int num_patches = 0;
  int label_words = 1;
  std::vector<uint64_t> labels;  // [num_scales, num_patches, label_words]
  std::vector<float> scales;     // [num_scales] quantiles; the same in scene units:
  std::vector<float> scene_scales;
  PairLists pairs;  // empty where the perception loss is left out
  uint32_t pair_seed = 0;
  uint32_t drawn_neighbors = 1;  // bits: columns of the neighbour graph, see SmoothFeatures
};

// A training view as the drawer sees it.
struct DrawableView {
  int view = 0;
  const MaskSet* masks = nullptr;        // that it learns from
  std::vector<float> mask_scales;        // [num_masks] scene units, or kNoScale
  std::vector<float> sorted_scales;      // those over 0, ascending
  std::vector<int32_t> pixels;           // under a mask that has a scale, not ignored
  PixelsByMask pixels_by_mask;           // of them
  std::vector<float> patch_weight;       // [num_patches] 1 / mean area of the masks with a scale
  std::vector<int32_t> background = {};  // see UncoveredPixels, as:
  std::vector<int32_t> unlabelled = {};
};

// masks: that each view of the capture learns from; they must outlive what comes out. Views without
// a pixel to draw are left out.
std::vector<DrawableView> MakeDrawableViews(const Capture& capture,
                                            std::span<const MaskSet* const> masks,
                                            std::span<const std::vector<float>> mask_scales);
// The views' own masks, by view of the capture, which must outlive them.
std::vector<const MaskSet*> OwnMasks(const Capture& capture);

// Draws batches, view after view shuffled without replacement, all from one seed. Which view and
// which random numbers a batch has is drawn one after the other; its content from these alone.
class BatchDrawer {
 public:
  // The views' masks and the field (for its quantiles) must outlive it.
  BatchDrawer(const FeatureField& field, std::vector<DrawableView> views,
              const FeatureOptions& options);

  struct Draft {
    int view = 0;  // index into views()
    uint64_t seed = 0;
    int step = 0;  // of the training, from 0 on
  };
  Draft Next();
  PixelBatch Draw(const Draft& draft) const;  // thread safe

  DrawerState Save() const;
  // step: of the next draft. DATA_LOSS: what it holds is no state of a drawer of these views.
  absl::Status Restore(const DrawerState& state, int step);

  const std::vector<DrawableView>& views() const { return views_; }

 private:
  using Random = std::mt19937_64;

  std::vector<float> DrawScales(const DrawableView& view, int step, Random& random) const;
  // The patches of the view that the batch has, by their number in it.
  std::vector<uint32_t> DrawPixels(const DrawableView& view, PixelBatch& batch,
                                   Random& random) const;
  void DrawBackground(const DrawableView& view, PixelBatch& batch, Random& random) const;
  void DrawUnlabelled(const DrawableView& view, PixelBatch& batch, Random& random) const;
  void Label(const DrawableView& view, std::span<const uint32_t> patches, PixelBatch& batch) const;

  const FeatureField& field_;
  std::vector<DrawableView> views_;
  FeatureOptions options_;
  Random random_;
  int step_ = 0;                 // of the next draft
  std::vector<int> views_left_;  // of this round
};

}  // namespace pepeseg
