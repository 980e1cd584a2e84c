#include "core/features/row_chunk.h"

#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

template <class T>
void Append(const std::vector<T>& from, std::vector<T>& to) {
  to.insert(to.end(), from.begin(), from.end());
}

template <class T>
void UploadTo(Backend& backend, const std::vector<T>& values, Buffer<T>& buffer) {
  buffer.Reserve(backend, static_cast<int64_t>(values.size()));
  buffer.Upload(std::span<const T>(values));
}

template <class T>
DeviceSpan<const T> SpanFrom(const Buffer<T>& buffer, int64_t first, size_t count) {
  return buffer.span().Subspan(first, static_cast<int64_t>(count));
}

// Returns the columns [range.first, range.second) of the columns of several batches, without
// weights.
ColumnSpan Columns(const Buffer<int32_t>& gaussian, const Buffer<int32_t>& first,
                   const Buffer<int32_t>& pixel, std::pair<int32_t, int32_t> range) {
  // The values of `first` index the whole of `pixel`, so that the subspan needs no copy: a column
  // ends where the next begins, also the last one of a batch.
  const int64_t count = range.second - range.first;
  return {gaussian.span().Subspan(range.first, count),
          first.span().Subspan(range.first, count + 1),
          pixel.span(),
          {}};
}

}  // namespace

absl::Status RowChunk::Refill(std::vector<PixelBatch> batches, const Capture& capture,
                              Renderer& scene, const NeighborGraph& graph) {
  next_ = 0;
  batches_ = std::move(batches);
  views_.clear();
  places_.assign(batches_.size(), {});
  // By view, ascending: the order decides the layout of the rows, and is the same in each run.
  std::map<int, std::vector<size_t>> batches_of_view;
  for (size_t i = 0; i < batches_.size(); ++i) batches_of_view[batches_[i].view].push_back(i);
  UploadBatches(scene.backend());
  for (const auto& [number, of_view] : batches_of_view) {
    ViewRows& view = views_.emplace_back();
    std::vector<int32_t> pixels;
    std::vector<uint32_t> drawn;
    for (const size_t batch : of_view) {
      places_[batch].view = views_.size() - 1;
      places_[batch].number = view.first_row.size();
      view.first_row.push_back(static_cast<int32_t>(pixels.size()));
      drawn.push_back(batches_[batch].drawn_neighbors);
      Append(batches_[batch].pixels, pixels);
    }
    view.first_row.push_back(static_cast<int32_t>(pixels.size()));
    view.rows = scene.Rows(capture.views[number], pixels);
    ListColumns(scene.backend(), graph, scene.num_gaussians(), drawn, view);
    // A backend that is out of memory leaves buffers empty: checked once per view, before a step
    // reads them.
    if (const std::string error = scene.backend().error(); !error.empty()) {
      return absl::ResourceExhaustedError(
          absl::StrCat("features: the blend rows of ", pixels.size(), " pixels of view ",
                       capture.views[number].name, " do not fit into memory: ", error,
                       "; lower steps_per_chunk"));
    }
  }
  return absl::OkStatus();
}

// Each member of a batch goes into one buffer for all batches: a few large copies instead of many
// small ones.
void RowChunk::UploadBatches(Backend& backend) {
  std::vector<float> weight, scales, share;
  std::vector<int32_t> cell, pair_first, pair_other;
  std::vector<PairCues> cues;
  std::vector<uint64_t> labels;
  for (size_t i = 0; i < batches_.size(); ++i) {
    places_[i].pixel = static_cast<int64_t>(weight.size());
    places_[i].label = static_cast<int64_t>(labels.size());
    places_[i].scale = static_cast<int64_t>(scales.size());
    const PairLists& pairs = batches_[i].pairs;
    places_[i].pair_first = static_cast<int64_t>(pair_first.size());
    places_[i].pair = static_cast<int64_t>(pair_other.size());
    places_[i].share = static_cast<int64_t>(share.size());
    Append(pairs.first, pair_first);
    Append(pairs.other, pair_other);
    Append(pairs.cues, cues);
    Append(pairs.share, share);
    Append(batches_[i].weight, weight);
    Append(batches_[i].cell, cell);
    Append(batches_[i].labels, labels);
    Append(batches_[i].scales, scales);
  }
  UploadTo(backend, weight, weight_);
  UploadTo(backend, cell, cell_);
  UploadTo(backend, labels, labels_);
  UploadTo(backend, scales, scales_);
  UploadTo(backend, pair_first, pair_first_);
  UploadTo(backend, pair_other, pair_other_);
  UploadTo(backend, cues, pair_cues_);
  UploadTo(backend, share, pair_share_);
}

// A group is a batch: its columns list the Gaussians that its pixels reach, and so on. All batches
// of the view are done by three calls, which saves waits of the host for the sizes.
void RowChunk::ListColumns(Backend& backend, const NeighborGraph& graph, int64_t num_gaussians,
                           std::span<const uint32_t> drawn, ViewRows& view) {
  const CapturedRows& rows = view.rows;
  backend.TransposeRows({.rows = {rows.first.span(), rows.gaussian.span(), rows.weight.span()},
                         .group_first = view.first_row,
                         .num_gaussians = num_gaussians,
                         .gaussian = &view.column_gaussian,
                         .first = &view.column_first,
                         .pixel = &view.column_pixel,
                         .weight = &view.column_weight,
                         .group_column = &view.first_column});
  backend.NeighborRows({.graph = graph,
                        .gaussian = view.column_gaussian.span(),
                        .group_first = view.first_column,
                        .drawn = drawn,
                        .row_first = &row_first_,
                        .row_gaussian = &row_gaussian_});
  backend.TransposeRows({.rows = {row_first_.span(), row_gaussian_.span(), {}},
                         .group_first = view.first_column,
                         .num_gaussians = num_gaussians,
                         .gaussian = &view.neighbor_gaussian,
                         .first = &view.neighbor_first,
                         .pixel = &view.neighbor_pixel,
                         .weight = nullptr,
                         .group_column = &view.first_neighbor});
}

RowChunk::Step RowChunk::Next() {
  const Place& place = places_[next_];
  const PixelBatch& batch = batches_[next_++];
  const ViewRows& view = views_[place.view];
  const size_t number = place.number, count = batch.pixels.size();
  const auto range = [&](const std::vector<int32_t>& firsts) {
    return std::pair(firsts[number], firsts[number + 1]);
  };
  ColumnSpan columns =
      Columns(view.column_gaussian, view.column_first, view.column_pixel, range(view.first_column));
  columns.weight = view.column_weight.span();
  return {&batch,
          {SpanFrom(view.rows.first, view.first_row[number], count + 1), view.rows.gaussian.span(),
           view.rows.weight.span()},
          columns,
          Columns(view.neighbor_gaussian, view.neighbor_first, view.neighbor_pixel,
                  range(view.first_neighbor)),
          SpanFrom(view.rows.alpha, view.first_row[number], count),
          SpanFrom(weight_, place.pixel, batch.weight.size()),
          SpanFrom(cell_, place.pixel, batch.cell.size()),
          SpanFrom(labels_, place.label, batch.labels.size()),
          SpanFrom(scales_, place.scale, batch.scales.size()),
          SpanFrom(pair_first_, place.pair_first, batch.pairs.first.size()),
          SpanFrom(pair_other_, place.pair, batch.pairs.other.size()),
          SpanFrom(pair_cues_, place.pair, batch.pairs.cues.size()),
          SpanFrom(pair_share_, place.share, batch.pairs.share.size())};
}

}  // namespace pepeseg
