#pragma once

#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "core/cluster/hdbscan.h"
#include "core/features/batch_drawer.h"
#include "core/features/centroid_bank.h"
#include "core/features/train_features.h"
#include "core/render/renderer.h"

namespace pepeseg {

// The centroid loss L_c (METHOD.md section 3, "Centroids"). Late in training, every few hundred
// steps, the masked pixels of one view are clustered by HDBSCAN at a large (upper) and a small
// (lower) scale, and the clusters' means go into a bank of each scale. Pixels whose gated feature
// is near a centroid of a bank are pulled onto it. A scale whose weight is 0 is left out.
class CentroidTerm {
 public:
  // All arguments but the options must outlive it.
  CentroidTerm(Backend& backend, const Capture& capture, Renderer& scene,
               const std::vector<DrawableView>& views, const FeatureOptions& options);

  // Returns whether the centroids are to be refreshed before this step, counted from 0.
  bool Due(int step) const;
  // Clusters the pixels of a random view and merges the clusters into the banks. features:
  // smoothed, [N, 32] of every Gaussian, in backend memory. gate: see FeatureField::gate. Waits for
  // the device. RESOURCE_EXHAUSTED: the pixels' rows do not fit into its memory.
  absl::Status Refresh(DeviceSpan<const float> features, std::span<const float> gate);

  CentroidState Save() const;
  // DATA_LOSS: `state` has no valid random state.
  absl::Status Restore(const CentroidState& state);

  // Returns whether any scale has a centroid.
  bool active() const;

  // What a step adds its gradients to, in backend memory.
  struct StepSpans {
    DeviceSpan<const float> pixel_features;  // [labelled pixels, 32]
    DeviceSpan<const float> gate;            // see CentroidLossArgs
    DeviceSpan<float> pixel_grad;            // [labelled pixels, 32] added to
    DeviceSpan<float> gate_grad;             // as gate; added to
  };
  // Adds the gradients of the loss, and keeps the step's sums for ReadLosses in the slot
  // `unread_step`, in [0, kMaxUnreadFeatureSteps).
  void AddGradients(const StepSpans& spans, int unread_step);
  // Returns the weighted losses of the slots 0 .. num_steps - 1. Waits for the device.
  std::vector<double> ReadLosses(int num_steps) const;

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

  void UploadBank(Level& level);
  // Returns up to max_pixels_ of the view's masked pixels, without repeats, ascending.
  std::vector<int32_t> DrawPixels(const DrawableView& view);
  // Returns the blended features of the pixels, [pixels, 32].
  std::vector<float> PixelFeatures(const View& view, std::span<const int32_t> pixels,
                                   DeviceSpan<const float> features);

  Backend& backend_;
  const Capture& capture_;
  Renderer& scene_;
  const std::vector<DrawableView>& views_;
  int first_step_, every_, max_pixels_;  // steps, steps, pixels
  bool check_masks_;                     // see FeatureOptions::centroid_check_masks
  std::mt19937_64 random_;
  std::vector<Level> levels_;
  Buffer<double> sums_;  // [kMaxUnreadFeatureSteps, levels, kNumCentroidSums]
};

}  // namespace pepeseg
