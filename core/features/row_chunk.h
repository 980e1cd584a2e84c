#pragma once

#include <algorithm>
#include <vector>

#include "absl/status/status.h"
#include "core/features/batch_drawer.h"
#include "core/render/frozen_scene.h"

namespace pepeseg {

// Batches drawn ahead, with all that their steps read but the features, in backend memory: each
// view is rasterised once a chunk, for the pixels of all its batches, and which Gaussians a batch
// reaches is listed for all batches of the view at once.
class RowChunk {
 public:
  struct Step {
    const PixelBatch* batch;
    RowSpan rows;                     // of the pixels
    ColumnSpan columns;               // the same by Gaussian
    ColumnSpan neighbors;             // of the columns' Gaussians over those they are smoothed with
    DeviceSpan<const float> alpha;    // [S]
    DeviceSpan<const float> weight;   // [labelled], as of the batch; likewise:
    DeviceSpan<const int32_t> patch;  // [labelled]
    DeviceSpan<const uint64_t> labels;
    DeviceSpan<const float> scales;
    DeviceSpan<const int32_t> pair_first, pair_other;
    DeviceSpan<const PairCues> pair_cues;
    DeviceSpan<const float> pair_share;
  };

  bool Exhausted() const { return next_ == batches_.size(); }
  // RESOURCE_EXHAUSTED when the rows do not fit.
  absl::Status Refill(std::vector<PixelBatch> batches, const Capture& capture, FrozenScene& scene,
                      const NeighborGraph& graph);
  // As if so many steps had been taken since the Refill, at most all.
  void Skip(int num_steps) { next_ = std::min(batches_.size(), static_cast<size_t>(num_steps)); }
  // Valid until the next Refill.
  Step Next();

 private:
  // The batches of one view.
  struct ViewRows {
    CapturedRows rows;
    Buffer<int32_t> column_gaussian, column_first, column_pixel;
    Buffer<float> column_weight;
    Buffer<int32_t> neighbor_gaussian, neighbor_first, neighbor_pixel;
    std::vector<int32_t> first_row, first_column, first_neighbor;  // [batches + 1]
  };
  struct Place {
    size_t view, number;  // of views_, of its batches
    // The first in the buffers of all batches.
    int64_t pixel, label, scale, pair_first, pair, share;
  };

  void UploadBatches(Backend& backend);
  void ListColumns(Backend& backend, const NeighborGraph& graph, int64_t num_gaussians,
                   std::span<const uint32_t> drawn, ViewRows& view);

  std::vector<PixelBatch> batches_;
  std::vector<Place> places_;  // of each batch
  std::vector<ViewRows> views_;
  Buffer<float> weight_, scales_, pair_share_;
  Buffer<int32_t> patch_, pair_first_, pair_other_;
  Buffer<PairCues> pair_cues_;
  Buffer<uint64_t> labels_;
  Buffer<int32_t> row_first_, row_gaussian_;  // of NeighborRows, for one view at a time
  size_t next_ = 0;
};

}  // namespace pepeseg
