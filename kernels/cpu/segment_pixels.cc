#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/math/pair.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 1024;  // pixels a task: its similarities stay in the cache
constexpr float kNever = -std::numeric_limits<float>::infinity();

// The largest of each column of [rows, kChunk]; never, where there is no row.
void BestOf(const float* rows, int64_t num_rows, int64_t count, float* best) {
  std::fill_n(best, count, kNever);
  for (int64_t row = 0; row < num_rows; ++row) {
    const float* values = rows + row * count;
    for (int64_t i = 0; i < count; ++i) best[i] = std::max(best[i], values[i]);
  }
}

struct ChunkSums {
  int64_t inside = 0, similarity = 0;
};

ChunkSums FillMask(const SegmentPixelsArgs& args, const float* positive, const float* negative,
                   int64_t first, int64_t count) {
  ChunkSums sums;
  uint8_t* mask = args.mask.data + first;
  for (int64_t i = 0; i < count; ++i) {
    const bool inside = positive[i] > args.threshold && positive[i] > negative[i];
    mask[i] = inside ? 1 : 0;
    sums.inside += inside ? 1 : 0;
    sums.similarity +=
        inside ? static_cast<int64_t>(std::lrintf(positive[i] * kSimilarityUnit)) : 0;
  }
  if (args.similarity.size > 0) std::copy_n(positive, count, args.similarity.data + first);
  return sums;
}

}  // namespace

void CpuBackend::SegmentPixels(const SegmentPixelsArgs& args) {
  if (failed()) return;
  std::vector<float> units(args.queries.size);
  for (int64_t first = 0; first < args.queries.size; first += kFeatureSize) {
    GatedUnit(args.psi.data, args.queries.data + first, kFeatureSize, units.data() + first);
  }
  const int64_t num_queries = args.queries.size / kFeatureSize;
  const int64_t num_pixels = args.map.size / kFeatureSize;
  std::vector<float> scratch(static_cast<size_t>(pool_.num_threads() * (num_queries + 2) * kChunk));
  std::atomic<int64_t> inside = 0, similarity = 0;
  pool_.ParallelFor((num_pixels + kChunk - 1) / kChunk, [&](int64_t task, int thread) {
    const int64_t first = task * kChunk, count = std::min(kChunk, num_pixels - first);
    float* of_queries = scratch.data() + thread * (num_queries + 2) * kChunk;
    float* positive = of_queries + num_queries * kChunk;
    float* negative = positive + kChunk;
    const SimilarityArgs chunk = {args.map.Subspan(first * kFeatureSize, count * kFeatureSize),
                                  args.psi,
                                  args.queries,
                                  args.min_norm,
                                  {of_queries, num_queries * count}};
    simd_.similarity(chunk, units.data(), {0, count});
    BestOf(of_queries, args.num_positive, count, positive);
    BestOf(of_queries + args.num_positive * count, num_queries - args.num_positive, count,
           negative);
    const ChunkSums sums = FillMask(args, positive, negative, first, count);
    inside += sums.inside;
    similarity += sums.similarity;
  });
  args.sums.data[kNumInside] = inside;
  args.sums.data[kSimilaritySum] = similarity;
}

}  // namespace pepeseg
