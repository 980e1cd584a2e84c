#pragma once

#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/features/checkpoint.h"
#include "core/features/options.h"
#include "core/features/random_draws.h"
#include "core/scene/capture.h"
#include "core/scene/model.h"

namespace pepeseg {

// The pairs of a batch's pixels for the perception loss: the arrays of PerceptionLossArgs.
// `other` is empty if there is no pair.
struct PairLists {
  std::vector<int32_t> first = {}, other = {};  // [S + 1], [entries]
  std::vector<uint32_t> cues = {};              // [entries]
  std::vector<float> share = {};                // [2, num_scales]
};

// The samples of one step. Nothing here depends on a feature, so batches can be drawn ahead.
struct PixelBatch {
  int view = 0;  // index in the capture
  // [S] y * width + x. First the labelled pixels: num_pixels under masks that have a scale, then
  // those of the background. The rest are unlabelled: no mask covers them in this view.
  std::vector<int32_t> pixels;
  int num_labelled = 0;
  std::vector<float> weight;        // [labelled] 1 / mean area of the masks over the pixel
  std::vector<int32_t> cell;        // [labelled] -> mask cell of this batch
  int num_cells = 0;                // mask cells; the last one is the background, if it is drawn
  int label_words = 1;              // 64-bit words of a label
  std::vector<uint64_t> labels;     // [num_scales, num_cells, label_words] see ScaleLabels
  std::vector<float> scales;        // [num_scales] query scales, [0, 1]
  std::vector<float> scene_scales;  // [num_scales] the same in scene units
  PairLists pairs;                  // empty where the perception loss is left out
  uint32_t pair_seed = 0;           // see PairLossArgs
  uint32_t drawn_neighbors = 1;     // the draw of the neighbour graph, see NeighborGraph
};

// A training view as the drawer sees it. Pixels are y * width + x.
struct DrawableView {
  int view = 0;                          // index in the capture
  const MaskSet* masks = nullptr;        // the masks to learn from; not owned
  std::vector<float> mask_scales;        // [num_masks] scene units, or kNoScale
  std::vector<float> sorted_scales;      // the scales over 0, ascending
  std::vector<int32_t> pixels;           // under a mask that has a scale, not ignored; ascending
  PixelsByMask pixels_by_mask;           // over `pixels`
  std::vector<float> cell_weight;        // [num_cells] 1 / mean area of the masks with a scale
  std::vector<int32_t> background = {};  // UncoveredPixels::background, if it is drawn
  std::vector<int32_t> unlabelled = {};  // other uncovered pixels, for the perception loss
};

// Returns the training views with a pixel to draw, without background and unlabelled pixels. masks,
// mask_scales: by view of the capture; `masks` must outlive the result.
std::vector<DrawableView> MakeDrawableViews(const Capture& capture,
                                            std::span<const MaskSet* const> masks,
                                            std::span<const std::vector<float>> mask_scales);
// Returns the views' own masks, by view of the capture. The capture must outlive them.
std::vector<const MaskSet*> OwnMasks(const Capture& capture);

// Draws the batches of stage two (METHOD.md section 3, "Samples"), all from one seed. A round takes
// each view once, in random order. Of more than views_per_chunk views it takes one subset after the
// other: views at even distances in the capture, each as often as fits into a chunk, in random
// order. Drafts are drawn one after the other. Each has its own seed, and a batch depends on its
// draft alone, so that batches can be drawn in parallel.
class BatchDrawer {
 public:
  // The field and the views must outlive it. Of the field it reads scale_quantiles.
  BatchDrawer(const FeatureField& field, const std::vector<DrawableView>& views,
              const FeatureOptions& options);

  struct Draft {
    int view = 0;  // index into views()
    uint64_t seed = 0;
    int step = 0;  // of the training, from 0
  };
  // Returns the draft of the next step. Not thread safe.
  Draft Next();
  // Returns how many of the next drafts, at least one, give batches with the same number of drawn
  // neighbours, of one subset of the views. Not thread safe.
  int NumAlike() const;
  // Returns the batch of a draft, without pairs. Thread safe.
  PixelBatch Draw(const Draft& draft) const;

  DrawerState Save() const;
  // Continues from `state`. step: the step of the next draft. DATA_LOSS: `state` is not the state
  // of a drawer of these views.
  absl::Status Restore(const DrawerState& state, int step);

 private:
  using Random = std::mt19937_64;

  void BeginRound();
  // Returns the number of views of a subset.
  size_t SubsetSize() const { return (views_.size() + num_subsets_ - 1) / num_subsets_; }
  // Returns the number of steps left of the subset that steps are drawn from.
  size_t NumLeftOfSubset() const { return (views_left_.size() - 1) % subset_steps_ + 1; }
  // Returns num_scales scales, scene units.
  std::vector<float> DrawScales(const DrawableView& view, int step, Random& random) const;
  // Draws the pixels under masks. Returns the view's mask cells that they lie in; their order is
  // that of PixelBatch::cell.
  std::vector<uint32_t> DrawPixels(const DrawableView& view, PixelBatch& batch,
                                   Random& random) const;
  void DrawBackground(const DrawableView& view, PixelBatch& batch, Random& random) const;
  void DrawUnlabelled(const DrawableView& view, PixelBatch& batch, Random& random) const;
  // Fills in the labels of the mask cells at each scale.
  void Label(const DrawableView& view, std::span<const uint32_t> cells, PixelBatch& batch) const;

  const FeatureField& field_;
  const std::vector<DrawableView>& views_;
  FeatureOptions options_;
  Random random_;
  int step_ = 0;                 // of the next draft
  std::vector<int> views_left_;  // of this round; indices into views_, the next subset last
  int num_subsets_ = 1;
  size_t subset_steps_ = 1;  // steps of a subset
};

}  // namespace pepeseg
