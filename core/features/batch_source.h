#pragma once

#include <future>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/features/batch_drawer.h"
#include "core/features/options.h"
#include "core/features/preparation.h"
#include "core/features/row_chunk.h"
#include "core/render/renderer.h"
#include "kernels/backend.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

// Returns whether the rows of two chunks may be in backend memory at once, so that chunks are
// shorter (OfTwoChunks): on a GPU, whether or not it has a twin, since estimates count on it.
bool HasTwoChunks(const Backend& backend);

// The inputs of the steps of stage two, a chunk of batches at a time. The next chunk is drawn on
// threads of its own while the current one is trained. With a twin of the backend the next chunk is
// also rasterised meanwhile, so that the device is not idle between two chunks, and the one after
// it is drawn. All calls must come from one thread.
class BatchSource {
 public:
  // `prepared` must outlive it. twin: see Backend::MakeTwin; null: chunks are rasterised when they
  // begin.
  BatchSource(const PreparedFeatures& prepared, const FeatureOptions& options,
              std::unique_ptr<Backend> twin);
  ~BatchSource();  // waits for the tasks, and with a twin for the device
  BatchSource(const BatchSource&) = delete;
  BatchSource& operator=(const BatchSource&) = delete;

  // Continues after `step` steps, the last steps_of_chunk of them from the chunk that begins at
  // `chunk_start`. To be called before the first Next. DATA_LOSS: see BatchDrawer::Restore.
  absl::Status Restore(const DrawerState& chunk_start, int step, int steps_of_chunk);

  // Returns what the next steps read, valid until the next call: `most` steps, or those that are
  // left of a chunk. Must be called for the steps of the schedule only. Waits for the device at the
  // start of a chunk. RESOURCE_EXHAUSTED: see RowChunk::Refill. INTERNAL: the twin failed.
  absl::StatusOr<std::vector<RowChunk::Step>> Next(int most);
  // Drops the last num_steps of the schedule. A chunk that is being drawn or rasterised is not
  // shortened.
  void LeaveOutLast(int num_steps);

  // The state of the drawer before the current chunk, and the steps taken from that: what Restore
  // takes. Before the first Next, the current chunk is the first one.
  const DrawerState& chunk_start() const { return chunk_start_; }
  int steps_of_chunk() const { return steps_of_chunk_; }

 private:
  struct DrawnChunk {
    DrawerState before;               // of the drawer before the first of the batches
    std::vector<PixelBatch> batches;  // with a twin they are in next_chunk_
    absl::Status rasterised;          // with a twin: of next_chunk_
  };
  // Starts the task that draws the next chunk that no task draws yet.
  void DrawAhead();
  // Starts the task that rasterises the chunk that is being drawn, and the one that draws the next.
  void RasteriseAhead();
  // Fills next_chunk_ on the twin. Errors as of RowChunk::Refill; INTERNAL: the device failed.
  absl::Status Rasterise(std::vector<PixelBatch> batches);
  // Takes the next chunk, without its first `num_done` steps. Without a twin rasterises its views.
  absl::Status BeginChunk(int num_done);
  Backend& backend() const { return prepared_.scene->backend(); }

  const PreparedFeatures& prepared_;
  const std::unique_ptr<Backend> twin_;
  const FeatureOptions options_;
  BatchDrawer drawer_;
  int num_left_;  // batches that no task has begun to draw
  ThreadPool pool_ = ThreadPool(0);
  std::future<DrawnChunk> drawing_;       // invalid before the first Next
  std::future<DrawnChunk> rasterising_;   // invalid without a twin
  std::unique_ptr<Renderer> twin_scene_;  // null without a twin
  RowChunk chunk_;
  RowChunk next_chunk_;  // filled by the task if there is a twin
  DrawerState chunk_start_;
  int steps_of_chunk_ = 0;
};

}  // namespace pepeseg
