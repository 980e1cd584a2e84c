#include <algorithm>
#include <cassert>
#include <span>
#include <tuple>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/tile_splats.h"
#include "kernels/math/blend.h"

// CaptureRows: rows of the blend matrix. Sampled pixels are grouped by tile, and a task walks the
// entries of one tile. The first pass counts the entries of each row; after the prefix sum over the
// rows a second pass writes them. Each row is written by one task, so the result does not depend on
// the number of threads.

namespace pepeseg {
namespace {

// A sampled pixel, ordered by its place: tile * kTilePixels + TilePixel.
struct Sample {
  int64_t place;
  int64_t number;  // index in CaptureRowsArgs::pixels

  friend bool operator<(const Sample& a, const Sample& b) {
    return std::tie(a.place, a.number) < std::tie(b.place, b.number);
  }
};

// Returns the samples sorted by place. Equal pixels stay in the order of the arguments.
std::vector<Sample> SamplesByPlace(const RenderScratch& scratch, DeviceSpan<const int32_t> pixels) {
  std::vector<Sample> samples(pixels.size);
  for (int64_t i = 0; i < pixels.size; ++i) {
    const int x = pixels[i] % scratch.width, y = pixels[i] / scratch.width;
    const int64_t tile = int64_t{y / kTileSize} * scratch.num_tiles_x + x / kTileSize;
    samples[i] = {tile * kTilePixels + TilePixel(x % kTileSize, y % kTileSize), i};
  }
  std::sort(samples.begin(), samples.end());
  return samples;
}

// The samples in one tile, which are walked together.
struct SampleGroup {
  std::span<const Sample> samples;
  TileSplats tile = {};         // cut after the last entry that any of the pixels has seen
  std::vector<int32_t> pixels;  // within the tile, ascending, without repeats
  std::vector<float> weights;   // [pixels, tile.count]

  // Weights of one of the samples, [tile.count].
  const float* WeightsOf(const Sample& sample) const {
    const auto pixel = static_cast<int32_t>(sample.place % kTilePixels);
    const auto at = std::lower_bound(pixels.begin(), pixels.end(), pixel);
    return weights.data() + (at - pixels.begin()) * tile.count;
  }
};

// Splits sorted samples where the tile changes.
std::vector<SampleGroup> SampleGroupsOf(std::span<const Sample> samples) {
  std::vector<SampleGroup> groups;
  for (size_t first = 0, end = 0; first < samples.size(); first = end) {
    const int64_t tile = samples[first].place / kTilePixels;
    while (end < samples.size() && samples[end].place / kTilePixels == tile) ++end;
    groups.push_back({samples.subspan(first, end - first), {}, {}, {}});
  }
  return groups;
}

// Computes the weights of all entries at the pixels of a group; 0 where an entry is skipped.
void FindWeights(const SimdKernels& simd, const CaptureRowsArgs& args, SampleGroup& group) {
  const RenderScratch& scratch = *args.scratch;
  group.tile = TileAt(scratch, group.samples[0].place / kTilePixels);
  // Entries after the last one that any of the pixels has seen have no weight.
  group.tile.count = 0;
  for (const Sample& sample : group.samples) {
    const auto pixel = static_cast<int32_t>(sample.place % kTilePixels);
    if (group.pixels.empty() || group.pixels.back() != pixel) group.pixels.push_back(pixel);
    group.tile.count =
        std::max(group.tile.count, scratch.pixel_last_entry.span()[args.pixels[sample.number]]);
  }
  group.weights.resize(group.pixels.size() * group.tile.count);
  simd.pixel_weights(group.tile, group.pixels, group.weights.data());
}

// Writes the row of one sample, whose first entry is known, with its alpha and depth.
void WriteRow(const CaptureRowsArgs& args, const SampleGroup& group, const Sample& sample) {
  const RenderScratch& scratch = *args.scratch;
  const int32_t* gaussians = scratch.visible_gaussian.span().data;
  const int32_t first = args.row_first->span()[sample.number];
  int32_t* gaussian = args.entry_gaussian->span().data + first;
  float* weight = args.entry_weight->span().data + first;
  const float* weights = group.WeightsOf(sample);
  float alpha = 0, depth = 0;
  for (int32_t k = 0; k < group.tile.count; ++k) {
    const float w = weights[k];
    if (!(w > 0)) continue;
    const int32_t visible = group.tile.entries[k];
    *gaussian++ = gaussians[visible];
    *weight++ = w;
    alpha += w;
    const float blended = group.tile.splats[visible].depth;
    depth += w * (scratch.inverse_depth ? InverseDepth(blended) : blended);
  }
  if (!args.pixel_alpha.empty()) args.pixel_alpha[sample.number] = alpha;
  if (!args.pixel_depth.empty()) args.pixel_depth[sample.number] = depth;
}

}  // namespace

void CpuBackend::CaptureRows(const CaptureRowsArgs& args) {
  if (failed()) return;
  const int64_t num_pixels = args.pixels.size;
  if (!args.row_first->Reserve(*this, num_pixels + 1)) return;
  int32_t* row_first = args.row_first->span().data;
  assert(row_first != nullptr);
  row_first[0] = 0;
  const std::vector<Sample> samples = SamplesByPlace(*args.scratch, args.pixels);
  std::vector<SampleGroup> groups = SampleGroupsOf(samples);
  const auto for_each_group = [&](auto&& body) {
    pool_.ParallelFor(static_cast<int64_t>(groups.size()),
                      [&](int64_t i, int) { body(groups[i]); });
  };
  for_each_group([&](SampleGroup& group) {
    FindWeights(simd_, args, group);
    for (const Sample& sample : group.samples) {
      const float* weights = group.WeightsOf(sample);
      row_first[sample.number + 1] = static_cast<int32_t>(
          std::count_if(weights, weights + group.tile.count, [](float w) { return w > 0; }));
    }
  });
  // Counts become first entries.
  for (int64_t i = 0; i < num_pixels; ++i) row_first[i + 1] += row_first[i];

  if (!args.entry_gaussian->Reserve(*this, row_first[num_pixels]) ||
      !args.entry_weight->Reserve(*this, row_first[num_pixels])) {
    return;
  }
  for_each_group([&](const SampleGroup& group) {
    for (const Sample& sample : group.samples) WriteRow(args, group, sample);
  });
}

namespace {

// The rows of one group, and where its columns and entries are written.
struct RowGroup {
  int64_t first_row, end_row;
  int64_t first_column, first_entry;
};

// The arrays that are written, see ColumnSpan.
struct Columns {
  int32_t *gaussian, *first, *pixel;
  float* weight;  // null: the rows have none
};

// Sets counts[gaussian] to the number of entries; returns the number of Gaussians with an entry.
int64_t CountEntries(const RowSpan& rows, const RowGroup& group, std::vector<int32_t>& counts) {
  std::fill(counts.begin(), counts.end(), 0);
  for (int32_t e = rows.first[group.first_row]; e < rows.first[group.end_row]; ++e) {
    ++counts[rows.gaussian[e]];
  }
  return static_cast<int64_t>(counts.size()) - std::count(counts.begin(), counts.end(), 0);
}

// Counting sort by Gaussian; stable, so pixels stay ascending. `next` holds the counts, and is used
// for the next free place of each Gaussian.
void SortEntries(const RowSpan& rows, const RowGroup& group, std::vector<int32_t>& next,
                 const Columns& out) {
  auto place = static_cast<int32_t>(group.first_entry);
  int64_t column = group.first_column;
  for (size_t gaussian = 0; gaussian < next.size(); ++gaussian) {
    const int32_t count = next[gaussian];
    if (count == 0) continue;
    out.gaussian[column] = static_cast<int32_t>(gaussian);
    out.first[column++] = place;
    next[gaussian] = place;
    place += count;
  }
  for (int64_t row = group.first_row; row < group.end_row; ++row) {
    for (int32_t e = rows.first[row]; e < rows.first[row + 1]; ++e) {
      const int32_t to = next[rows.gaussian[e]]++;
      out.pixel[to] = static_cast<int32_t>(row - group.first_row);
      if (out.weight != nullptr) out.weight[to] = rows.weight[e];
    }
  }
}

// The row ranges of the groups; columns and entries are still to be set.
std::vector<RowGroup> RowGroupsOf(const TransposeRowsArgs& args) {
  if (args.group_first.empty()) return {{0, args.rows.first.size - 1, 0, 0}};
  std::vector<RowGroup> groups;
  for (size_t g = 0; g + 1 < args.group_first.size(); ++g) {
    groups.push_back({args.group_first[g], args.group_first[g + 1], 0, 0});
  }
  return groups;
}

}  // namespace

// A task is a group. Groups are counted twice, before and after their sizes are known, rather than
// keeping a count of all Gaussians for each of them.
void CpuBackend::TransposeRows(const TransposeRowsArgs& args) {
  if (failed()) return;
  const RowSpan& rows = args.rows;
  std::vector<RowGroup> groups = RowGroupsOf(args);
  const auto num_groups = static_cast<int64_t>(groups.size());
  std::vector<std::vector<int32_t>> counts(pool_.num_threads());
  for (std::vector<int32_t>& of_thread : counts) of_thread.resize(args.num_gaussians);
  std::vector<int64_t> num_columns(groups.size());
  pool_.ParallelFor(num_groups, [&](int64_t g, int thread) {
    num_columns[g] = CountEntries(rows, groups[g], counts[thread]);
  });
  // Columns of a group follow those of the group before it.
  int64_t num_touched = 0;
  if (args.group_column != nullptr) args.group_column->clear();
  for (size_t g = 0; g < groups.size(); ++g) {
    groups[g].first_column = num_touched;
    groups[g].first_entry = rows.first[groups[g].first_row] - rows.first[groups[0].first_row];
    if (args.group_column != nullptr) {
      args.group_column->push_back(static_cast<int32_t>(num_touched));
    }
    num_touched += num_columns[g];
  }
  if (args.group_column != nullptr) args.group_column->push_back(static_cast<int32_t>(num_touched));
  const bool weighted = rows.weight.size != 0;
  const int64_t num_entries =
      groups.empty() ? 0 : rows.first[groups.back().end_row] - rows.first[groups[0].first_row];
  if (!args.gaussian->Reserve(*this, num_touched) || !args.first->Reserve(*this, num_touched + 1) ||
      !args.pixel->Reserve(*this, num_entries) ||
      (weighted && !args.weight->Reserve(*this, num_entries))) {
    return;
  }
  const Columns out = {args.gaussian->span().data, args.first->span().data, args.pixel->span().data,
                       weighted ? args.weight->span().data : nullptr};
  assert(out.first != nullptr);
  pool_.ParallelFor(num_groups, [&](int64_t g, int thread) {
    CountEntries(rows, groups[g], counts[thread]);
    SortEntries(rows, groups[g], counts[thread], out);
  });
  out.first[num_touched] = static_cast<int32_t>(num_entries);
}

}  // namespace pepeseg
