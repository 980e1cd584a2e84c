#include "kernels/ops/similarity.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/math/feature.h"

namespace pepeseg {
namespace {

constexpr int64_t kBestChunk = 1024;  // pixels of a task: its similarities stay in the cache

// Returns the queries as SimdKernels::similarity takes them, [num_queries, 32]: gated, of length 1.
std::vector<float> GatedUnits(const float* psi, DeviceSpan<const float> queries) {
  std::vector<float> units(static_cast<size_t>(queries.size));
  for (int64_t first = 0; first < queries.size; first += kFeatureSize) {
    GatedUnit(psi, queries.data + first, kFeatureSize, units.data() + first);
  }
  return units;
}

// Writes the largest value of each column of [num_rows, count] to best[count]. NaN values are
// skipped. Without rows the result is -infinity.
void BestOfRows(const float* rows, int64_t num_rows, int64_t count, float* best) {
  std::fill_n(best, count, -std::numeric_limits<float>::infinity());
  for (int64_t row = 0; row < num_rows; ++row) {
    const float* values = rows + row * count;
    for (int64_t i = 0; i < count; ++i) best[i] = std::max(best[i], values[i]);
  }
}

// The largest similarity of each pixel to the positive queries and to the others, [count] each.
struct BestSimilarity {
  const float* positive;
  const float* negative;
};
// Computes them for the `count` pixels of queries.map, of which the first num_positive queries are
// positive. `units` is from GatedUnits. The result points into `scratch`, [num_queries + 2, count];
// queries.similarity is not used.
BestSimilarity BestSimilarityOf(const SimdKernels& simd, const SimilarityArgs& queries,
                                const float* units, int num_positive, float* scratch) {
  const int64_t count = queries.map.size / kFeatureSize;
  const int64_t num_queries = queries.queries.size / kFeatureSize;
  SimilarityArgs each = queries;
  each.similarity = {scratch, num_queries * count};
  simd.similarity(each, units, {0, count});
  float* positive = scratch + num_queries * count;
  float* negative = positive + count;
  BestOfRows(scratch, num_positive, count, positive);
  BestOfRows(scratch + num_positive * count, num_queries - num_positive, count, negative);
  return {positive, negative};
}

}  // namespace

// Queries are gated and normalised once, pixels for each chunk.
void CpuBackend::Similarity(const SimilarityArgs& args) {
  if (failed()) return;
  constexpr int64_t kChunk = 4096;  // pixels of a task
  const std::vector<float> units = GatedUnits(args.psi.data, args.queries);
  const int64_t count = args.map.size / kFeatureSize;
  pool_.ParallelFor((count + kChunk - 1) / kChunk, [&](int64_t i, int) {
    simd_.similarity(args, units.data(), {i * kChunk, std::min(count, (i + 1) * kChunk)});
  });
}

namespace {

struct ChunkSums {
  int64_t inside = 0, similarity = 0;
};

// Writes the mask of `count` pixels from `first` on, and their similarities if wanted.
ChunkSums FillMask(const SegmentPixelsArgs& args, const BestSimilarity& best, int64_t first,
                   int64_t count) {
  ChunkSums sums;
  uint8_t* mask = args.mask.data + first;
  for (int64_t i = 0; i < count; ++i) {
    const bool inside = best.positive[i] > args.threshold && best.positive[i] > best.negative[i];
    mask[i] = inside ? 1 : 0;
    sums.inside += inside ? 1 : 0;
    sums.similarity +=
        inside ? static_cast<int64_t>(std::lrintf(best.positive[i] * kSimilarityUnit)) : 0;
  }
  if (args.similarity.size > 0) std::copy_n(best.positive, count, args.similarity.data + first);
  return sums;
}

}  // namespace

// Sums are of integers, so that the order of the chunks does not matter.
void CpuBackend::SegmentPixels(const SegmentPixelsArgs& args) {
  if (failed()) return;
  const std::vector<float> units = GatedUnits(args.psi.data, args.queries);
  const int64_t num_queries = args.queries.size / kFeatureSize;
  const int64_t num_pixels = args.map.size / kFeatureSize;
  std::vector<float> scratch(
      static_cast<size_t>(pool_.num_threads() * (num_queries + 2) * kBestChunk));
  std::atomic<int64_t> inside = 0, similarity = 0;
  pool_.ParallelFor((num_pixels + kBestChunk - 1) / kBestChunk, [&](int64_t task, int thread) {
    const int64_t first = task * kBestChunk, count = std::min(kBestChunk, num_pixels - first);
    const SimilarityArgs chunk = {args.map.Subspan(first * kFeatureSize, count * kFeatureSize),
                                  args.psi,
                                  args.queries,
                                  args.min_norm,
                                  {}};
    const BestSimilarity best =
        BestSimilarityOf(simd_, chunk, units.data(), args.num_positive,
                         scratch.data() + thread * (num_queries + 2) * kBestChunk);
    const ChunkSums sums = FillMask(args, best, first, count);
    inside += sums.inside;
    similarity += sums.similarity;
  });
  args.sums.data[kNumInside] = inside;
  args.sums.data[kSimilaritySum] = similarity;
}

// A multiplication gathers eight bytes of 0 or 1 into the upper byte.
void CpuBackend::PackMask(const PackMaskArgs& args) {
  if (failed()) return;
  constexpr uint64_t kGather = 0x0102'0408'1020'4080;
  const uint8_t* const mask = args.mask.data;
  for (int64_t word = 0; word < args.bits.size; ++word) {
    const int64_t first = 32 * word, count = std::min<int64_t>(32, args.mask.size - first);
    uint8_t pixels[32] = {};
    std::memcpy(pixels, mask + first, static_cast<size_t>(count));
    uint32_t bits = 0;
    for (int i = 0; i < 4; ++i) {
      uint64_t eight;
      std::memcpy(&eight, pixels + 8 * i, 8);
      bits |= static_cast<uint32_t>((eight * kGather) >> 56) << (8 * i);
    }
    args.bits.data[word] = bits;
  }
}

namespace {

// Writes the threshold levels of `count` pixels.
void FillLevels(DeviceSpan<const float> thresholds, const BestSimilarity& best, int64_t count,
                uint8_t* levels) {
  std::fill_n(levels, count, uint8_t{0});
  for (int64_t t = 0; t < thresholds.size; ++t) {  // one pass each, so that it vectorises
    const float threshold = thresholds.data[t];
    for (int64_t i = 0; i < count; ++i) levels[i] += best.positive[i] > threshold ? 1 : 0;
  }
  for (int64_t i = 0; i < count; ++i) {
    if (!(best.positive[i] > best.negative[i])) levels[i] = 0;
  }
}

// Adds the pixels of a chunk to `counts` [scales, scales, side, side], for pairs of scales a <= b.
// `levels` is at the chunk's first pixel; the next scale is `stride` after it.
void CountPairs(const uint8_t* levels, int64_t stride, int64_t count, int num_scales, int side,
                int32_t* counts) {
  uint8_t of_pixel[kMaxLevelScales];
  for (int64_t i = 0; i < count; ++i) {
    // A pixel in no mask at any scale is not counted.
    int any = 0;
    for (int s = 0; s < num_scales; ++s) any |= of_pixel[s] = levels[s * stride + i];
    if (any == 0) continue;
    for (int a = 0; a < num_scales; ++a) {
      int32_t* row = counts + (a * num_scales * side + of_pixel[a]) * side;
      for (int b = a; b < num_scales; ++b) ++row[b * side * side + of_pixel[b]];
    }
  }
}

}  // namespace

// A task takes its pixels through all scales. Each thread counts in an array of its own; counts are
// integers, so the order in which the arrays are added does not matter.
void CpuBackend::LevelOverlaps(const LevelOverlapsArgs& args) {
  if (failed()) return;
  const int64_t num_pixels = args.map.size / kFeatureSize;
  const auto num_scales = static_cast<int>(args.psi.size / kFeatureSize);
  const int side = static_cast<int>(args.thresholds.size) + 1;
  std::vector<std::vector<float>> units;
  units.reserve(num_scales);
  for (int s = 0; s < num_scales; ++s) {
    units.push_back(GatedUnits(args.psi.data + s * kFeatureSize, args.queries));
  }
  const int64_t rows = args.queries.size / kFeatureSize + 2;
  std::vector<float> scratch(static_cast<size_t>(pool_.num_threads() * rows * kBestChunk));
  std::vector<int32_t> counts(static_cast<size_t>(pool_.num_threads() * args.overlaps.size));
  pool_.ParallelFor((num_pixels + kBestChunk - 1) / kBestChunk, [&](int64_t task, int thread) {
    const int64_t first = task * kBestChunk, count = std::min(kBestChunk, num_pixels - first);
    for (int s = 0; s < num_scales; ++s) {
      const SimilarityArgs chunk = {args.map.Subspan(first * kFeatureSize, count * kFeatureSize),
                                    args.psi.Subspan(s * kFeatureSize, kFeatureSize),
                                    args.queries,
                                    args.min_norm,
                                    {}};
      const BestSimilarity best = BestSimilarityOf(simd_, chunk, units[s].data(), args.num_positive,
                                                   scratch.data() + thread * rows * kBestChunk);
      FillLevels(args.thresholds, best, count, args.levels.data + s * num_pixels + first);
    }
    CountPairs(args.levels.data + first, num_pixels, count, num_scales, side,
               counts.data() + thread * args.overlaps.size);
  });
  std::fill_n(args.overlaps.data, args.overlaps.size, 0);
  for (size_t i = 0; i < counts.size(); ++i) {
    args.overlaps.data[static_cast<int64_t>(i) % args.overlaps.size] += counts[i];
  }
  // CountPairs also counted pixels of level 0 at both scales if they have a level at another.
  for (int64_t pair = 0; pair < args.overlaps.size; pair += side * side) {
    args.overlaps.data[pair] = 0;
  }
}

}  // namespace pepeseg
