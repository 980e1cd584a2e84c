#include "core/features/batch_source.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {

bool HasTwoChunks(const Backend& backend) { return backend.queue_depth() > 0; }

BatchSource::BatchSource(const PreparedFeatures& prepared, const FeatureOptions& options,
                         std::unique_ptr<Backend> twin)
    : prepared_(prepared),
      twin_(std::move(twin)),
      options_(HasTwoChunks(backend()) ? OfTwoChunks(options) : options),
      drawer_(prepared.field, prepared.views, options_),
      num_left_(options.num_steps),
      chunk_start_(drawer_.Save()) {
  if (twin_ == nullptr) return;
  backend().Sync();  // the twin reads the Gaussians and their neighbours
  twin_scene_ = std::make_unique<Renderer>(*twin_, *prepared.scene);
}

BatchSource::~BatchSource() {
  if (drawing_.valid()) drawing_.wait();
  if (rasterising_.valid()) rasterising_.wait();
  if (twin_ != nullptr) backend().Sync();  // steps may still read the chunk
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
absl::StatusOr<std::vector<RowChunk::Step>> BatchSource::Next(int most) {
  if (!drawing_.valid()) {
    DrawAhead();
    if (twin_ != nullptr) RasteriseAhead();
    RETURN_IF_ERROR(BeginChunk(steps_of_chunk_));
  }
  if (chunk_.num_left() == 0) RETURN_IF_ERROR(BeginChunk(0));
  std::vector<RowChunk::Step> steps;
  for (int i = std::min(most, chunk_.num_left()); i > 0; --i) steps.push_back(chunk_.Next());
  steps_of_chunk_ += static_cast<int>(steps.size());
  return steps;
}

absl::Status BatchSource::BeginChunk(int num_done) {
  DrawnChunk drawn = (twin_ != nullptr ? rasterising_ : drawing_).get();
  if (twin_ != nullptr) {
    RETURN_IF_ERROR(drawn.rasterised);
    backend().Sync();  // steps may still read the chunk that the task fills next
    std::swap(chunk_, next_chunk_);
    RasteriseAhead();
  } else {
    DrawAhead();
    RETURN_IF_ERROR(chunk_.Refill(std::move(drawn.batches), prepared_.capture, *prepared_.scene,
                                  prepared_.graph()));
  }
  chunk_start_ = std::move(drawn.before);
  steps_of_chunk_ = num_done;
  chunk_.Skip(num_done);
  return absl::OkStatus();
}

// All batches of a chunk draw the same number of neighbours, because NeighborRows requires it.
// Drafts are taken here, so that a chunk may be drawn while the one before it still is.
void BatchSource::DrawAhead() {
  const int count = std::min({options_.steps_per_chunk, num_left_, drawer_.NumAlike()});
  num_left_ -= count;
  DrawnChunk chunk = {drawer_.Save(), std::vector<PixelBatch>(static_cast<size_t>(count)),
                      absl::OkStatus()};
  std::vector<BatchDrawer::Draft> drafts;
  for (int i = 0; i < count; ++i) drafts.push_back(drawer_.Next());
  drawing_ = std::async(std::launch::async,
                        [this, chunk = std::move(chunk), drafts = std::move(drafts)]() mutable {
                          pool_.ParallelFor(std::ssize(drafts), [&](int64_t i, int) {
                            chunk.batches[i] = drawer_.Draw(drafts[i]);
                            if (prepared_.cues != nullptr) prepared_.cues->List(chunk.batches[i]);
                          });
                          return std::move(chunk);
                        });
}

void BatchSource::RasteriseAhead() {
  rasterising_ = std::async(std::launch::async, [this, drawing = std::move(drawing_)]() mutable {
    DrawnChunk chunk = drawing.get();
    if (!chunk.batches.empty()) chunk.rasterised = Rasterise(std::move(chunk.batches));
    return chunk;
  });
  DrawAhead();
}

// The chunk is the other backend's to read when the twin has been waited for.
absl::Status BatchSource::Rasterise(std::vector<PixelBatch> batches) {
  RETURN_IF_ERROR(
      next_chunk_.Refill(std::move(batches), prepared_.capture, *twin_scene_, prepared_.graph()));
  const BackendError error = twin_->TakeError();
  if (error.what.empty()) return absl::OkStatus();
  return absl::InternalError(absl::StrCat("features: blend rows: ", error.what));
}

}  // namespace pepeseg
