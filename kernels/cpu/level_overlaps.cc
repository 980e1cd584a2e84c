#include <algorithm>
#include <cstring>
#include <vector>

#include "kernels/cpu/best_similarity.h"
#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 1024;  // pixels of a task: its similarities stay in the cache

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
  std::vector<float> scratch(static_cast<size_t>(pool_.num_threads() * rows * kChunk));
  std::vector<int32_t> counts(static_cast<size_t>(pool_.num_threads() * args.overlaps.size));
  pool_.ParallelFor((num_pixels + kChunk - 1) / kChunk, [&](int64_t task, int thread) {
    const int64_t first = task * kChunk, count = std::min(kChunk, num_pixels - first);
    for (int s = 0; s < num_scales; ++s) {
      const SimilarityArgs chunk = {args.map.Subspan(first * kFeatureSize, count * kFeatureSize),
                                    args.psi.Subspan(s * kFeatureSize, kFeatureSize),
                                    args.queries,
                                    args.min_norm,
                                    {}};
      const BestSimilarity best = BestSimilarityOf(simd_, chunk, units[s].data(), args.num_positive,
                                                   scratch.data() + thread * rows * kChunk);
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
