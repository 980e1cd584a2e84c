#include <algorithm>
#include <cassert>
#include <span>
#include <tuple>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/tile_splats.h"
#include "kernels/math/blend.h"

// Rows of the blend matrix. Sampled pixels are grouped by tile and pair of scanlines, because the
// SIMD walk may work on two scanlines at once; a task walks one group. The first pass counts the
// entries of each row; after the prefix sum over the rows a second pass writes them. Each row is
// written by one task, so the result does not depend on the number of threads.

namespace pepeseg {
namespace {

// A sampled pixel, ordered by its place: the tile, the pair of scanlines in it, the pixel in these.
struct Sample {
  int64_t place;
  int64_t number;  // index in CaptureRowsArgs::pixels

  friend bool operator<(const Sample& a, const Sample& b) {
    return std::tie(a.place, a.number) < std::tie(b.place, b.number);
  }
};
constexpr int64_t kPairPixels = 2 * kTileSize;
constexpr int64_t kPairs = kTileSize / 2;

// Returns the samples sorted by place. Equal pixels stay in the order of the arguments.
std::vector<Sample> SamplesByPlace(const RenderScratch& scratch, DeviceSpan<const int32_t> pixels) {
  std::vector<Sample> samples(pixels.size);
  for (int64_t i = 0; i < pixels.size; ++i) {
    const int x = pixels[i] % scratch.width, y = pixels[i] / scratch.width;
    const int64_t tile = int64_t{y / kTileSize} * scratch.num_tiles_x + x / kTileSize;
    const int in_tile = y % kTileSize * kTileSize + x % kTileSize;
    samples[i] = {tile * kPairs * kPairPixels + in_tile, i};
  }
  std::sort(samples.begin(), samples.end());
  return samples;
}

// The samples in one pair of scanlines of a tile, which are walked together.
struct Group {
  std::span<const Sample> samples;
  TileSplats tile = {};         // cut after the last entry that any of the pixels has seen
  std::vector<int32_t> pixels;  // within the tile, ascending, without repeats
  std::vector<float> weights;   // [pixels, tile.count]

  // Weights of one of the samples, [tile.count].
  const float* WeightsOf(const Sample& sample) const {
    const auto pixel = static_cast<int32_t>(sample.place % (kPairs * kPairPixels));
    const auto at = std::lower_bound(pixels.begin(), pixels.end(), pixel);
    return weights.data() + (at - pixels.begin()) * tile.count;
  }
};

// Splits sorted samples where the pair of scanlines changes.
std::vector<Group> GroupsOf(std::span<const Sample> samples) {
  std::vector<Group> groups;
  for (size_t first = 0, end = 0; first < samples.size(); first = end) {
    const int64_t pair = samples[first].place / kPairPixels;
    while (end < samples.size() && samples[end].place / kPairPixels == pair) ++end;
    groups.push_back({samples.subspan(first, end - first), {}, {}, {}});
  }
  return groups;
}

// Computes the weights of all entries at the pixels of a group; 0 where an entry is skipped.
void FindWeights(const SimdKernels& simd, const CaptureRowsArgs& args, Group& group) {
  const RenderScratch& scratch = *args.scratch;
  group.tile = TileAt(scratch, group.samples[0].place / (kPairs * kPairPixels));
  // Entries after the last one that any of the pixels has seen have no weight.
  group.tile.count = 0;
  for (const Sample& sample : group.samples) {
    const auto pixel = static_cast<int32_t>(sample.place % (kPairs * kPairPixels));
    if (group.pixels.empty() || group.pixels.back() != pixel) group.pixels.push_back(pixel);
    group.tile.count =
        std::max(group.tile.count, scratch.pixel_last_entry.span()[args.pixels[sample.number]]);
  }
  group.weights.resize(group.pixels.size() * group.tile.count);
  simd.pixel_weights(group.tile, group.pixels, group.weights.data());
}

// Writes the row of one sample, whose first entry is known, with its alpha and depth.
void WriteRow(const CaptureRowsArgs& args, const Group& group, const Sample& sample) {
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
  std::vector<Group> groups = GroupsOf(samples);
  const auto for_each_group = [&](auto&& body) {
    pool_.ParallelFor(static_cast<int64_t>(groups.size()),
                      [&](int64_t i, int) { body(groups[i]); });
  };
  for_each_group([&](Group& group) {
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
  for_each_group([&](const Group& group) {
    for (const Sample& sample : group.samples) WriteRow(args, group, sample);
  });
}

}  // namespace pepeseg
