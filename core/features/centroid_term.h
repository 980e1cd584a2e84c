#pragma once

#include <cstdint>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/cluster/hdbscan.h"
#include "core/features/batch_drawer.h"
#include "core/features/loss_term.h"
#include "core/features/options.h"
#include "core/render/renderer.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// Share of a cluster's labelled pixels that one mask must hold for the cluster to be kept.
inline constexpr double kMinAgreement = 0.7;

// Returns the clusters of a view's pixels without those that its masks tell apart: a cluster is
// dropped if no mask holds kMinAgreement of its pixels that have a label at `scale` (see
// ScaleLabels). Otherwise the centroid loss would pull together for good what the features still
// confuse. A cluster without a labelled pixel is kept. Pixels of dropped clusters become noise, the
// remaining clusters keep their order.
//
// pixels: y * width + x of each cluster label. mask_scales: [num_masks] scene units. scale: scene
// units.
Clusters KeepAgreeing(const Clusters& clusters, const MaskSet& masks,
                      std::span<const int32_t> pixels, std::span<const float> mask_scales,
                      float scale);

// The directions of the gated features of the clusters seen so far, at one scale.
class CentroidBank {
 public:
  // merge_cosine: a cluster whose mean has a larger cosine with a centroid is that centroid again.
  explicit CentroidBank(float merge_cosine) : merge_cosine_(merge_cosine) {}

  // Replaces the centroids, [K, 32].
  void Set(std::vector<float> centroids) { centroids_ = std::move(centroids); }

  // Adds the means of the clusters of one view, [count, 32] of length 1, or 0 for a cluster of
  // pixels that show nothing, which is left out. A mean that matches a centroid moves the nearest
  // one by a tenth of the way, others become new centroids. Means of the same call are never merged
  // with each other: HDBSCAN has found them to be apart.
  void Merge(std::span<const float> means);

  // [K, 32] of length 1.
  const std::vector<float>& centroids() const { return centroids_; }

 private:
  float merge_cosine_;
  std::vector<float> centroids_;
};

// The centroid loss L_c (METHOD.md section 3, "Centroids"). Late in training, every few hundred
// steps, the pixels of random views, masked ones by default, are clustered by HDBSCAN at a large
// (upper) and a small (lower) scale, and the clusters' means go into a bank of each scale. Pixels
// whose gated feature is near a centroid of a bank are pulled onto it. A scale whose weight is 0 is
// left out.
class CentroidTerm final : public LossTerm {
 public:
  // All arguments but the options must outlive it.
  CentroidTerm(Backend& backend, const Capture& capture, Renderer& scene,
               const std::vector<DrawableView>& views, const FeatureOptions& options);

  // Returns whether the centroids are to be refreshed before this step, counted from 0.
  bool Due(int step) const;
  // Clusters the pixels of random views and merges the clusters into the banks. features:
  // smoothed, [N, 32] of every Gaussian, in backend memory. gate: see FeatureField::gate. Waits for
  // the device. RESOURCE_EXHAUSTED: the pixels' rows do not fit into its memory.
  absl::Status Refresh(DeviceSpan<const float> features, std::span<const float> gate);

  CentroidState Save() const;
  // DATA_LOSS: `state` has no valid random state.
  absl::Status Restore(const CentroidState& state);

  bool IsIn(const RowChunk::Step&) const override { return active(); }
  void AddGradients(const RowChunk::Step& step, const Spans& spans, int unread_step) override;
  std::vector<double> ReadLosses(int num_steps) override;

 private:
  // The loss at one scale.
  struct Level {
    bool upper;
    float scale;       // quantile scale
    float weight;      // of the loss
    float min_cosine;  // a pixel is pulled if its cosine with the nearest centroid is larger
    HdbscanOptions hdbscan;
    CentroidBank bank;
    Buffer<float> centroids;  // the bank, in backend memory
  };

  // Returns whether any scale has a centroid.
  bool active() const;
  void UploadBank(Level& level);
  // Does for one view what Refresh says.
  absl::Status MergeView(const DrawableView& view, DeviceSpan<const float> features,
                         std::span<const float> gate);
  // Returns up to max_pixels_ of the view's pixels that are clustered, without repeats, ascending.
  std::vector<int32_t> DrawPixels(const DrawableView& view);
  // Returns the blended features of the pixels, [pixels, 32].
  std::vector<float> PixelFeatures(const View& view, std::span<const int32_t> pixels,
                                   DeviceSpan<const float> features);

  Backend& backend_;
  const Capture& capture_;
  Renderer& scene_;
  const std::vector<DrawableView>& views_;
  int first_step_, every_, max_pixels_;  // steps, steps, pixels
  int num_views_;                        // see FeatureOptions::centroid_views
  bool masked_only_;                     // see FeatureOptions::centroid_masked_only
  bool check_masks_;                     // see FeatureOptions::centroid_check_masks
  std::mt19937_64 random_;
  std::vector<Level> levels_;
  Buffer<double> sums_;  // [kMaxUnreadFeatureSteps, levels, kNumCentroidSums]
};

}  // namespace pepeseg
