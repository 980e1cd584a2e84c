#pragma once

#include <vector>

#include "core/features/row_chunk.h"
#include "core/features/train_features.h"
#include "kernels/backend.h"

namespace pepeseg {

// Features, gate and optimiser in backend memory, and the update of one batch.
class FeatureTrainer {
 public:
  FeatureTrainer(Backend& backend, int64_t num_gaussians, const FeatureOptions& options);

  // Returns the loss of the batch, before the update.
  double Train(const RowChunk::Step& step);

  // Brings all rows up to date and fills features and gate. Features are normalised; those that no
  // sample ever touched are zero, so that they resemble nothing.
  void Export(FeatureField& field);

 private:
  void Upload(const PixelBatch& batch);
  FeatureState State() {
    return {features_.span(), moment1_.span(), moment2_.span(), last_step_.span()};
  }
  ColumnSpan Columns() const {
    return {column_gaussian_.span(), column_first_.span(), column_pixel_.span(),
            column_weight_.span()};
  }

  Backend& backend_;
  int64_t num_gaussians_;
  int step_ = 0;  // updates done
  FeatureRates rates_;
  Buffer<float> correction_;                    // see FeatureRates
  Buffer<float> features_, moment1_, moment2_;  // [N, 32]
  Buffer<int32_t> last_step_;                   // [N]
  Buffer<float> gate_, gate_moment1_, gate_moment2_, gate_grad_;
  // Of the batch.
  Buffer<int32_t> column_gaussian_, column_first_, column_pixel_, patch_;
  Buffer<float> column_weight_, pixel_features_, pixel_grad_, pixel_weight_, scales_;
  Buffer<uint64_t> labels_;
  Buffer<double> sums_;
};

}  // namespace pepeseg
