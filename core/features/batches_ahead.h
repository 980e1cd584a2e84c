#pragma once

#include <algorithm>
#include <future>
#include <vector>

#include "core/features/batch_drawer.h"

namespace pepeseg {

// Draws the batches of the next chunk on a thread of its own while one chunk is trained.
class BatchesAhead {
 public:
  // The drawer must outlive it, and nobody else may call it.
  BatchesAhead(BatchDrawer& drawer, int num_batches, int chunk_size)
      : drawer_(drawer), num_left_(num_batches), chunk_size_(chunk_size) {
    Begin();
  }

  // The next chunk's; empty after the last.
  std::vector<PixelBatch> Next() {
    std::vector<PixelBatch> batches = next_.get();
    Begin();
    return batches;
  }

 private:
  void Begin() {
    const int count = std::min(chunk_size_, num_left_);
    num_left_ -= count;
    next_ = std::async(std::launch::async, [this, count] {
      std::vector<PixelBatch> batches(static_cast<size_t>(count));
      for (PixelBatch& batch : batches) batch = drawer_.Next();
      return batches;
    });
  }

  BatchDrawer& drawer_;
  int num_left_;
  int chunk_size_;
  std::future<std::vector<PixelBatch>> next_;  // its destructor waits
};

}  // namespace pepeseg
