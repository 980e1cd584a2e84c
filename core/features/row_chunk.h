#pragma once

#include <vector>

#include "absl/status/status.h"
#include "core/features/batch_drawer.h"
#include "core/features/frozen_scene.h"

namespace pepeseg {

// Batches drawn ahead with their rows: each view is rasterised once a chunk, for the pixels of all
// its batches.
class RowChunk {
 public:
  struct Step {
    const PixelBatch* batch;
    RowSpan rows;
    DeviceSpan<const float> alpha;  // [S]
  };

  bool Exhausted() const { return next_ == batches_.size(); }
  // RESOURCE_EXHAUSTED when the rows do not fit.
  absl::Status Refill(BatchDrawer& drawer, int num_batches, const Capture& capture,
                      FrozenScene& scene);
  // Valid until the next Refill.
  Step Next();

 private:
  struct Place {
    size_t rows;    // index in rows_
    int64_t first;  // row
  };
  std::vector<PixelBatch> batches_;
  std::vector<Place> places_;  // of each batch
  std::vector<CapturedRows> rows_;
  size_t next_ = 0;
};

}  // namespace pepeseg
