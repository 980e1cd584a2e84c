#pragma once

#include <future>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/features/batch_drawer.h"
#include "core/features/options.h"
#include "core/features/preparation.h"
#include "core/features/row_chunk.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

// The inputs of the steps of stage two, a chunk of batches at a time. Draws the next chunk on
// threads of its own while the current one is trained: one task at a time uses the drawer; it takes
// the drafts in order, then draws the batches in parallel. All calls must come from one thread.
class BatchSource {
 public:
  // `prepared` must outlive it.
  BatchSource(const PreparedFeatures& prepared, const FeatureOptions& options);
  ~BatchSource();  // waits for the task
  BatchSource(const BatchSource&) = delete;
  BatchSource& operator=(const BatchSource&) = delete;

  // Continues after `step` steps, the last steps_of_chunk of them from the chunk that begins at
  // `chunk_start`. To be called before the first Next. DATA_LOSS: see BatchDrawer::Restore.
  absl::Status Restore(const DrawerState& chunk_start, int step, int steps_of_chunk);

  // Returns what the next step reads, valid until the next call. Must be called for the steps of
  // the schedule only. Waits for the device at the start of a chunk. RESOURCE_EXHAUSTED: see
  // RowChunk::Refill.
  absl::StatusOr<RowChunk::Step> Next();
  // Drops the last num_steps of the schedule. A chunk that is being drawn is not shortened.
  void LeaveOutLast(int num_steps);

  // The state of the drawer before the current chunk, and the steps taken from that: what Restore
  // takes. Before the first Next, the current chunk is the first one.
  const DrawerState& chunk_start() const { return chunk_start_; }
  int steps_of_chunk() const { return steps_of_chunk_; }

 private:
  struct DrawnChunk {
    DrawerState before;  // of the drawer before the first of the batches
    std::vector<PixelBatch> batches;
  };
  // Starts the task that draws a chunk.
  void DrawAhead();
  // Takes the next chunk, without its first `num_done` steps, and rasterises its views.
  absl::Status BeginChunk(int num_done);

  const PreparedFeatures& prepared_;
  BatchDrawer drawer_;
  const int steps_per_chunk_;
  int num_left_;  // batches that no task has begun to draw
  ThreadPool pool_ = ThreadPool(0);
  std::future<DrawnChunk> ahead_;  // invalid before the first Next
  RowChunk chunk_;
  DrawerState chunk_start_;
  int steps_of_chunk_ = 0;
};

}  // namespace pepeseg
