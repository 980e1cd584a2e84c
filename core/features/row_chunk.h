#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "core/features/batch_drawer.h"
#include "core/render/renderer.h"

namespace pepeseg {

// A chunk of batches, with everything that their steps read except the features, in backend memory
// (METHOD.md section 3, "Rows"). Each view is rasterised once a chunk, for the pixels of all its
// batches; the Gaussians that each batch reaches are listed for all batches of the view at once.
class RowChunk {
 public:
  // Input of one step. S is the number of pixels of its batch.
  struct Step {
    const PixelBatch* batch;
    RowSpan rows;                   // blend rows of the pixels
    ColumnSpan columns;             // the same entries by Gaussian
    ColumnSpan neighbors;           // rows of neighbours of the columns' Gaussians, by neighbour
    DeviceSpan<const float> alpha;  // [S] accumulated alpha
    // The members of the batch with these names, and those of its pairs.
    DeviceSpan<const float> weight;  // [labelled]
    DeviceSpan<const int32_t> cell;  // [labelled]
    DeviceSpan<const uint64_t> labels;
    DeviceSpan<const float> scales;
    DeviceSpan<const int32_t> pair_first, pair_other;
    DeviceSpan<const PairCues> pair_cues;
    DeviceSpan<const float> pair_share;
  };

  // Returns the number of batches that have not been taken.
  int num_left() const { return static_cast<int>(batches_.size() - next_); }
  // Replaces the batches and rasterises their views. Waits for the device. RESOURCE_EXHAUSTED: the
  // blend rows do not fit into its memory.
  absl::Status Refill(std::vector<PixelBatch> batches, const Capture& capture, Renderer& scene,
                      const NeighborGraph& graph);
  // Skips to the batch after the first num_steps of the chunk, at most to its end. To be called
  // after a Refill.
  void Skip(int num_steps) { next_ = std::min(batches_.size(), static_cast<size_t>(num_steps)); }
  // Returns what the next batch's step reads, valid until the next Refill. One must be left.
  Step Next();

 private:
  // The rows and columns of all batches of one view. Batches of a view lie one after the other.
  struct ViewRows {
    CapturedRows rows;
    Buffer<int32_t> column_gaussian, column_first, column_pixel;
    Buffer<float> column_weight;
    Buffer<int32_t> neighbor_gaussian, neighbor_first, neighbor_pixel;
    // [batches of the view + 1] the first row, column and neighbour column of each batch.
    std::vector<int32_t> first_row, first_column, first_neighbor;
  };
  // Place of a batch.
  struct Place {
    size_t view, number;  // index in views_, index among the batches of that view
    // Index of its first value in the buffers that hold all batches.
    int64_t pixel, label, scale, pair_first, pair, share;
  };

  void UploadBatches(Backend& backend);
  // Transposes the rows of a view, lists the neighbours of each batch's Gaussians by its draw, and
  // transposes these lists.
  void ListColumns(Backend& backend, const NeighborGraph& graph, int64_t num_gaussians,
                   std::span<const uint32_t> drawn, ViewRows& view);

  std::vector<PixelBatch> batches_;
  std::vector<Place> places_;  // of each batch
  std::vector<ViewRows> views_;
  Buffer<float> weight_, scales_, pair_share_;
  Buffer<int32_t> cell_, pair_first_, pair_other_;
  Buffer<PairCues> pair_cues_;
  Buffer<uint64_t> labels_;
  Buffer<int32_t> row_first_, row_gaussian_;  // output of NeighborRows for the current view
  size_t next_ = 0;                           // batch
};

}  // namespace pepeseg
