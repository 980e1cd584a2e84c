#pragma once

#include <algorithm>
#include <future>
#include <utility>
#include <vector>

#include "core/features/batch_drawer.h"
#include "core/features/perception_cues.h"
#include "kernels/cpu/parallel_for.h"

namespace pepeseg {

// Draws the batches of the next chunk on threads of its own while one chunk is trained.
class BatchesAhead {
 public:
  struct Chunk {
    DrawerState before;  // where the drawer stood
    std::vector<PixelBatch> batches;
  };

  // The drawer must outlive it, and nobody else may call it. cues: null where no pairs are listed.
  BatchesAhead(BatchDrawer& drawer, const PerceptionCues* cues, int num_batches, int chunk_size)
      : drawer_(drawer),
        cues_(cues),
        start_(drawer.Save()),
        num_left_(num_batches),
        chunk_size_(chunk_size) {
    Begin();
  }

  // Where the drawer stood at first.
  const DrawerState& start() const { return start_; }

  // So many batches of the end are not wanted.
  void Forgo(int num_batches) { num_left_ = std::max(0, num_left_ - num_batches); }

  // The next chunk; empty after the last.
  Chunk Next() {
    Chunk chunk = next_.get();
    Begin();
    return chunk;
  }

 private:
  void Begin() {
    const int count = std::min(chunk_size_, num_left_);
    num_left_ -= count;
    next_ = std::async(std::launch::async, [this, count] {
      Chunk chunk = {drawer_.Save(), std::vector<PixelBatch>(static_cast<size_t>(count))};
      std::vector<BatchDrawer::Draft> drafts;
      drafts.reserve(chunk.batches.size());
      for (int i = 0; i < count; ++i) drafts.push_back(drawer_.Next());
      pool_.ParallelFor(count, [&](int64_t i, int) {
        chunk.batches[i] = drawer_.Draw(drafts[i]);
        if (cues_ != nullptr) cues_->List(chunk.batches[i]);
      });
      return chunk;
    });
  }

  BatchDrawer& drawer_;
  const PerceptionCues* cues_;
  ThreadPool pool_ = ThreadPool(0);
  DrawerState start_;
  int num_left_;
  int chunk_size_;
  std::future<Chunk> next_;  // its destructor waits
};

}  // namespace pepeseg
