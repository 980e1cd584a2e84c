#include "core/features/row_chunk.h"

#include <map>

#include "absl/strings/str_cat.h"

namespace pepeseg {

absl::Status RowChunk::Refill(BatchDrawer& drawer, int num_batches, const Capture& capture,
                              FrozenScene& scene) {
  next_ = 0;
  batches_.clear();
  rows_.clear();
  places_.assign(num_batches, {});
  std::map<int, std::vector<int>> batches_of_view;
  for (int i = 0; i < num_batches; ++i) {
    batches_.push_back(drawer.Next());
    batches_of_view[batches_.back().view].push_back(i);
  }
  for (const auto& [view, batches] : batches_of_view) {
    std::vector<int32_t> pixels;
    for (const int batch : batches) {
      places_[batch] = {rows_.size(), static_cast<int64_t>(pixels.size())};
      pixels.insert(pixels.end(), batches_[batch].pixels.begin(), batches_[batch].pixels.end());
    }
    rows_.push_back(scene.Capture(capture.views[view], pixels));
    if (rows_.back().first.size() != static_cast<int64_t>(pixels.size()) + 1) {
      return absl::ResourceExhaustedError(
          absl::StrCat("features: no memory for the rows of ", pixels.size(), " pixels of view ",
                       capture.views[view].name, "; try fewer steps_per_chunk"));
    }
  }
  return absl::OkStatus();
}

RowChunk::Step RowChunk::Next() {
  const Place& place = places_[next_];
  const PixelBatch& batch = batches_[next_++];
  const CapturedRows& rows = rows_[place.rows];
  const auto count = static_cast<int64_t>(batch.pixels.size());
  return {
      &batch,
      {rows.first.span().Subspan(place.first, count + 1), rows.gaussian.span(), rows.weight.span()},
      rows.alpha.span().Subspan(place.first, count)};
}

}  // namespace pepeseg
