#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "absl/status/status.h"
#include "core/cluster/hdbscan.h"
#include "core/features/batch_drawer.h"
#include "core/features/train_features.h"
#include "core/render/frozen_scene.h"

namespace pepeseg {

// What clusters were seen at one scale: directions of gated features. A cluster that is seen again,
// by its cosine, moves its centroid by a tenth of the way.
class CentroidBank {
 public:
  explicit CentroidBank(float merge_cosine) : merge_cosine_(merge_cosine) {}

  void Set(std::vector<float> centroids) { centroids_ = std::move(centroids); }

  void Merge(std::span<const float> means);                           // [count, 32] of length 1
  const std::vector<float>& centroids() const { return centroids_; }  // [K, 32]

 private:
  float merge_cosine_;
  std::vector<float> centroids_;
};

// The centroid loss L_c (METHOD.md section 3): late in training, now and then, the masked pixels of
// a view are clustered at a large and at a small scale; pixels near a centroid are pulled onto it.
class CentroidTerm {
 public:
  // All must outlive it.
  CentroidTerm(Backend& backend, const Capture& capture, FrozenScene& scene,
               const std::vector<DrawableView>& views, const FeatureOptions& options);

  // Whether a refresh comes before this step, counted from 0.
  bool Due(int step) const;
  // features: smoothed, of every Gaussian, in the backend's memory. gate: [kGateSize].
  absl::Status Refresh(DeviceSpan<const float> features, std::span<const float> gate);

  CentroidState Save() const;
  absl::Status Restore(const CentroidState& state);

  bool active() const;  // some scale has a centroid
  // Adds its gradients to `args`' and leaves its sums of a step; see ReadLosses.
  struct StepSpans {
    DeviceSpan<const float> pixel_features, gate;
    DeviceSpan<float> pixel_grad, gate_grad;
  };
  void AddGradients(const StepSpans& spans, int unread_step);
  // The weighted loss of each of the first steps since the last call.
  std::vector<double> ReadLosses(int num_steps) const;

 private:
  struct Level {
    bool upper;
    float scale;  // quantile
    float weight;
    float min_cosine;  // of what is pulled
    HdbscanOptions hdbscan;
    CentroidBank bank;
    Buffer<float> centroids;
  };

  void UploadBank(Level& level);
  std::vector<int32_t> DrawPixels(const DrawableView& view);
  std::vector<float> PixelFeatures(const View& view, std::span<const int32_t> pixels,
                                   DeviceSpan<const float> features);

  Backend& backend_;
  const Capture& capture_;
  FrozenScene& scene_;
  const std::vector<DrawableView>& views_;
  int first_step_, every_, max_pixels_;
  std::mt19937_64 random_;
  std::vector<Level> levels_;
  Buffer<double> sums_;  // [kMaxUnreadSteps, levels, kNumCentroidSums]
};

}  // namespace pepeseg
