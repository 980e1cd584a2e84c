#pragma once

#include <span>
#include <vector>

#include "core/features/centroid_term.h"
#include "core/features/row_chunk.h"
#include "core/features/train_features.h"
#include "kernels/backend.h"

namespace pepeseg {

// Features, gate and optimiser in backend memory, and the update of one batch.
class FeatureTrainer {
 public:
  // The features to begin with, [num_gaussians, 32]: drawn, which takes a while.
  static std::vector<float> InitialFeatures(int64_t num_gaussians, const FeatureOptions& options);

  // The centroid term must outlive it.
  FeatureTrainer(Backend& backend, std::span<const float> initial, const NeighborGraph& graph,
                 CentroidTerm& centroids, const FeatureOptions& options);

  // After the first num_done steps, the rest of the learning rate's fall is done in num_left_out
  // steps less.
  void LeaveOut(int num_done, int num_left_out);

  // Waits for nothing. At most kMaxUnreadFeatureSteps between two calls of ReadLosses.
  void Train(const RowChunk::Step& step);
  absl::Status RefreshCentroids();
  // The losses of the steps since it was last called, each before its update. Waits for them.
  std::vector<double> ReadLosses();

  FeatureRowsState Save() const;
  // Of a checkpoint of as many Gaussians, after `step` updates.
  void Restore(const FeatureRowsState& rows, int step);

  // Brings all rows up to date and fills features and gate. Features are smoothed over all
  // neighbours and normalised; they are zero, so that they resemble nothing, where no sample ever
  // touched any neighbour.
  void Export(FeatureField& field);

 private:
  void AddPerception(const RowChunk::Step& step);
  // Over all neighbours, of every row.
  void SmoothAll(DeviceSpan<const float> features);
  FeatureState State() {
    return {features_.span(), moment1_.span(), moment2_.span(), last_step_.span()};
  }

  Backend& backend_;
  int64_t num_gaussians_;
  NeighborGraph graph_;
  CentroidTerm& centroids_;
  int step_ = 0;  // updates done
  const FeatureOptions options_;
  FeatureRates rates_;
  Buffer<float> correction_;                    // see FeatureRates
  Buffer<float> features_, moment1_, moment2_;  // [N, 32]
  Buffer<int32_t> last_step_;                   // [N]
  Buffer<float> smoothed_, inv_length_;         // [N, 32], [N]: see SmoothFeatures
  Buffer<float> gate_, gate_moment1_, gate_moment2_, gate_grad_;
  // Of the batch.
  Buffer<float> pixel_features_, pixel_grad_, sum_grad_;
  Buffer<double> sums_;             // [kMaxUnreadFeatureSteps, kNumPairLossSums]
  Buffer<double> perception_loss_;  // [kMaxUnreadFeatureSteps] 0 where a step has no pair
  float perception_weight_;
  int num_unread_ = 0;
};

}  // namespace pepeseg
