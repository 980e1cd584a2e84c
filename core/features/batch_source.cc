#include "core/features/batch_source.h"

#include <algorithm>
#include <utility>

#include "core/base/status_macros.h"

namespace pepeseg {

BatchSource::BatchSource(const PreparedFeatures& prepared, const FeatureOptions& options)
    : prepared_(prepared),
      drawer_(prepared.field, prepared.views, options),
      steps_per_chunk_(options.steps_per_chunk),
      num_left_(options.num_steps),
      chunk_start_(drawer_.Save()) {}

BatchSource::~BatchSource() {
  if (ahead_.valid()) ahead_.wait();
}

absl::Status BatchSource::Restore(const DrawerState& chunk_start, int step, int steps_of_chunk) {
  const int before_chunk = step - steps_of_chunk;
  RETURN_IF_ERROR(drawer_.Restore(chunk_start, before_chunk));
  num_left_ -= before_chunk;
  chunk_start_ = chunk_start;
  steps_of_chunk_ = steps_of_chunk;
  return absl::OkStatus();
}

void BatchSource::LeaveOutLast(int num_steps) { num_left_ = std::max(0, num_left_ - num_steps); }

// After Restore the whole chunk is drawn and rasterised again, and its steps that are already done
// are skipped: they may be all of it.
absl::StatusOr<RowChunk::Step> BatchSource::Next() {
  if (!ahead_.valid()) {
    DrawAhead();
    RETURN_IF_ERROR(BeginChunk(steps_of_chunk_));
  }
  if (chunk_.Exhausted()) RETURN_IF_ERROR(BeginChunk(0));
  ++steps_of_chunk_;
  return chunk_.Next();
}

absl::Status BatchSource::BeginChunk(int num_done) {
  DrawnChunk drawn = ahead_.get();
  DrawAhead();
  chunk_start_ = std::move(drawn.before);
  steps_of_chunk_ = num_done;
  RETURN_IF_ERROR(chunk_.Refill(std::move(drawn.batches), prepared_.capture, *prepared_.scene,
                                prepared_.graph()));
  chunk_.Skip(num_done);
  return absl::OkStatus();
}

// All batches of a chunk draw the same number of neighbours, because NeighborRows requires it.
void BatchSource::DrawAhead() {
  const int count = std::min({steps_per_chunk_, num_left_, drawer_.NumAlike()});
  num_left_ -= count;
  ahead_ = std::async(std::launch::async, [this, count] {
    DrawnChunk chunk = {drawer_.Save(), std::vector<PixelBatch>(static_cast<size_t>(count))};
    std::vector<BatchDrawer::Draft> drafts;
    drafts.reserve(chunk.batches.size());
    for (int i = 0; i < count; ++i) drafts.push_back(drawer_.Next());
    pool_.ParallelFor(count, [&](int64_t i, int) {
      chunk.batches[i] = drawer_.Draw(drafts[i]);
      if (prepared_.cues != nullptr) prepared_.cues->List(chunk.batches[i]);
    });
    return chunk;
  });
}

}  // namespace pepeseg
