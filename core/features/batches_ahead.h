#pragma once

#include <algorithm>
#include <future>
#include <utility>
#include <vector>

#include "core/features/batch_drawer.h"
#include "core/features/perception_cues.h"
#include "kernels/cpu/parallel_for.h"

namespace pepeseg {

// Draws the batches of the next chunk on threads of its own while the current chunk is trained.
// One asynchronous task at a time uses the drawer: it takes the drafts in order, then draws the
// batches in parallel. All calls must come from one thread; the destructor waits for the task.
class BatchesAhead {
 public:
  struct Chunk {
    DrawerState before;  // of the drawer before the first of the batches, for checkpoints
    std::vector<PixelBatch> batches;
  };

  // The drawer and the cues must outlive it, and nobody else may call the drawer. cues: null if no
  // pairs are to be listed. num_batches: of all chunks together.
  BatchesAhead(BatchDrawer& drawer, const PerceptionCues* cues, int num_batches, int chunk_size)
      : drawer_(drawer),
        cues_(cues),
        start_(drawer.Save()),
        num_left_(num_batches),
        chunk_size_(chunk_size) {
    Begin();
  }

  // Returns the state of the drawer before the first chunk.
  const DrawerState& start() const { return start_; }

  // Drops the last `num_batches` of the schedule. Chunks that are being drawn are not shortened.
  void Skip(int num_batches) { num_left_ = std::max(0, num_left_ - num_batches); }

  // Returns the next chunk and starts drawing the one after it. Waits if it is still being drawn.
  // Empty after the last one.
  Chunk Next() {
    Chunk chunk = next_.get();
    Begin();
    return chunk;
  }

 private:
  // Starts the task that draws a chunk.
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
  int num_left_;  // batches that no task has begun to draw
  int chunk_size_;
  // Declared last: its destructor waits for the task, which uses the members above.
  std::future<Chunk> next_;
};

}  // namespace pepeseg
