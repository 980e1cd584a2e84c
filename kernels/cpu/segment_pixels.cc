#include <algorithm>
#include <atomic>
#include <cmath>
#include <vector>

#include "kernels/cpu/best_similarity.h"
#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 1024;  // pixels of a task: its similarities stay in the cache

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
  std::vector<float> scratch(static_cast<size_t>(pool_.num_threads() * (num_queries + 2) * kChunk));
  std::atomic<int64_t> inside = 0, similarity = 0;
  pool_.ParallelFor((num_pixels + kChunk - 1) / kChunk, [&](int64_t task, int thread) {
    const int64_t first = task * kChunk, count = std::min(kChunk, num_pixels - first);
    const SimilarityArgs chunk = {args.map.Subspan(first * kFeatureSize, count * kFeatureSize),
                                  args.psi,
                                  args.queries,
                                  args.min_norm,
                                  {}};
    const BestSimilarity best =
        BestSimilarityOf(simd_, chunk, units.data(), args.num_positive,
                         scratch.data() + thread * (num_queries + 2) * kChunk);
    const ChunkSums sums = FillMask(args, best, first, count);
    inside += sums.inside;
    similarity += sums.similarity;
  });
  args.sums.data[kNumInside] = inside;
  args.sums.data[kSimilaritySum] = similarity;
}

}  // namespace pepeseg
