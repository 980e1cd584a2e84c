#include <cuda_runtime.h>
#include <thrust/iterator/counting_iterator.h>
#include <thrust/iterator/transform_iterator.h>

#include <algorithm>
#include <array>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#include <cub/device/device_select.cuh>
#include <numeric>
#include <span>
#include <vector>

#include "kernels/buffer.h"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/sift_pyramid.cuh"
#include "kernels/cuda/sift_windows.cuh"

// SIFT on the device (kernels/ops/sift.h). Launches, ordered by the stream:
//   BuildSiftOctave   the blurred images of an octave (sift_pyramid.cu)
//   SearchKernel      a warp owns 32 neighbouring pixels, a lane one: a bit for each extremum
//   running sum       of the bits of words, by cub; the host waits for their number
//   RefineKernel      one thread per word: fits its extrema, and counts the points of each scale
//   selection         of the points of the scales that are kept, by cub
//   two sorts         by scale, and by y and x, by cub; both are stable
//   directions, running sum of their numbers, descriptors (sift_windows.cu)
// The host waits for the number of extrema, for the counts of the scales and for the number of
// features, and once more for the first two if octave -1 is needed.
//
// Points are written in the order of octaves, scales and pixels, sorts are stable, and atomics only
// count: features are the same in every run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
constexpr int kSearchBlockY = 8;
constexpr int kNumScales = kSiftOctaves * kSiftStep;

// Bits of the pixels of an octave that are extrema, a word for 32 of a scanline.
struct OctaveWords {
  SiftOctave octave;
  int index;      // of the octave
  int per_row;    // words of a scanline
  int64_t first;  // word of scale 1, scanline 0

  int64_t count() const { return int64_t{kSiftStep} * octave.height * per_row; }
};

// Value of difference `level` at a pixel of level 0 of an octave.
__device__ float DogAt(const float* pixel, int64_t plane, int level) {
  return pixel[(level + 1) * plane] - pixel[level * plane];
}

// Returns whether the value exceeds, or is below, those of all its neighbours.
__device__ bool IsExtremum(const SiftOctave& octave, const float* pixel, int level, float value) {
  bool maximum = value >= 0.8f * kSiftContrast, minimum = value <= -0.8f * kSiftContrast;
  for (int k = 0; k < 27 && (maximum || minimum); ++k) {
    // The own difference comes first, then the finer and the coarser one.
    const int of_level = k < 9 ? level : k < 18 ? level - 1 : level + 1;
    if (k == 4) continue;  // the pixel itself
    const int64_t offset = (k / 3 % 3 - 1) * octave.stride + k % 3 - 1;
    const float other = DogAt(pixel + offset, octave.plane(), of_level);
    maximum = maximum && value > other;
    minimum = minimum && value < other;
  }
  return maximum || minimum;
}

__global__ void __launch_bounds__(32 * kSearchBlockY) SearchKernel(OctaveWords p, uint32_t* words) {
  const int x = static_cast<int>(blockIdx.x) * 32 + static_cast<int>(threadIdx.x);
  const int y = static_cast<int>(blockIdx.y) * kSearchBlockY + static_cast<int>(threadIdx.y);
  if (y >= p.octave.height) return;
  const bool inner = x > 0 && x < p.octave.width - 1 && y > 0 && y < p.octave.height - 1;
  const float* pixel = p.octave.Row(0, y) + x;
  for (int level = 1; level <= kSiftStep; ++level) {
    const bool found =
        inner && IsExtremum(p.octave, pixel, level, DogAt(pixel, p.octave.plane(), level));
    const uint32_t word = __ballot_sync(~0u, found);
    if (threadIdx.x == 0) {
      words[p.first + (int64_t{level - 1} * p.octave.height + y) * p.per_row + blockIdx.x] = word;
    }
  }
}

struct RefineParams {
  OctaveWords octave;
  const uint32_t* words;
  const int32_t* first;   // place of the first point of each word
  const uint8_t* ignore;  // null: none
  int width, height;      // of the photograph
  SiftFound* points;      // a point that is refused gets octave -1
  int32_t* counts;        // [kNumScales]
};

// Fits the extremum at a pixel. Returns whether it is a point.
__device__ bool Refine(const RefineParams& p, int x, int y, int level, SiftFound* point) {
  const SiftOctave& octave = p.octave.octave;
  const auto dog = [&](int px, int py, int at) {
    return DogAt(octave.Row(0, py) + px, octave.plane(), at);
  };
  if (!RefineExtremum(dog, octave.width, octave.height, x, y, level, &point->in_octave)) {
    return false;
  }
  point->octave = p.octave.index;
  point->keypoint = ToPhotograph(point->in_octave, octave.step);
  if (p.ignore == nullptr) return true;
  const int px = min(static_cast<int>(point->keypoint.x), p.width - 1);
  const int py = min(static_cast<int>(point->keypoint.y), p.height - 1);
  return p.ignore[int64_t{py} * p.width + px] == 0;
}

__global__ void __launch_bounds__(kBlock) RefineKernel(RefineParams p) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  const int64_t rows = int64_t{kSiftStep} * p.octave.octave.height;
  if (i >= rows * p.octave.per_row) return;
  const int64_t row = i / p.octave.per_row, word = p.octave.first + i;
  const int x = static_cast<int>(i % p.octave.per_row) * 32;
  const int y = static_cast<int>(row % p.octave.octave.height);
  const int level = static_cast<int>(row / p.octave.octave.height) + 1;
  SiftFound* point = p.points + p.first[word];
  for (uint32_t bits = p.words[word]; bits != 0; bits &= bits - 1, ++point) {
    if (Refine(p, x + __ffs(static_cast<int>(bits)) - 1, y, level, point)) {
      atomicAdd(p.counts + point->scale(), 1);
    } else {
      point->octave = -1;
    }
  }
}

struct NumBits {
  __device__ int32_t operator()(uint32_t word) const { return __popc(word); }
};
using WordBits = thrust::transform_iterator<NumBits, const uint32_t*, int32_t, int32_t>;

struct IsKept {
  int finest;  // scale
  __device__ bool operator()(const SiftFound& point) const {
    return point.octave >= 0 && point.scale() >= finest;
  }
};

// Key of the order of points by scale. Positive floats order as their bits do.
__global__ void __launch_bounds__(kBlock)
    ScaleKeyKernel(const SiftFound* points, int count, uint32_t* keys, int32_t* index) {
  const int i = static_cast<int>(blockIdx.x) * kBlock + static_cast<int>(threadIdx.x);
  if (i >= count) return;
  keys[i] = __float_as_uint(points[i].keypoint.scale);
  index[i] = i;
}
// Key of their order by y and x.
__global__ void __launch_bounds__(kBlock)
    PlaceKeyKernel(const SiftFound* points, int count, const int32_t* index, uint64_t* keys) {
  const int i = static_cast<int>(blockIdx.x) * kBlock + static_cast<int>(threadIdx.x);
  if (i >= count) return;
  const SiftKeypoint& at = points[index[i]].keypoint;
  keys[i] = uint64_t{__float_as_uint(at.y)} << 32 | __float_as_uint(at.x);
}
__global__ void __launch_bounds__(kBlock)
    GatherKernel(const SiftFound* points, int count, const int32_t* index, SiftFound* sorted) {
  const int i = static_cast<int>(blockIdx.x) * kBlock + static_cast<int>(threadIdx.x);
  if (i < count) sorted[i] = points[index[i]];
}

// Working memory for the points that are kept.
struct KeptPoints {
  SiftFound *points, *sorted;
  uint32_t *scale_keys, *other_scale_keys;
  uint64_t *place_keys, *other_place_keys;
  int32_t *index, *other_index;
  SiftAngles* angles;
  int32_t *num_angles, *first;  // [count + 1]
  int32_t* num_selected;
  std::byte* cub;
  size_t cub_bytes;
};
KeptPoints TakeKeptPoints(Arena& arena, int64_t count, size_t cub_bytes) {
  return {arena.Take<SiftFound>(count),
          arena.Take<SiftFound>(count),
          arena.Take<uint32_t>(count),
          arena.Take<uint32_t>(count),
          arena.Take<uint64_t>(count),
          arena.Take<uint64_t>(count),
          arena.Take<int32_t>(count),
          arena.Take<int32_t>(count),
          arena.Take<SiftAngles>(count),
          arena.Take<int32_t>(count + 1),
          arena.Take<int32_t>(count + 1),
          arena.Take<int32_t>(1),
          arena.Take<std::byte>(static_cast<int64_t>(cub_bytes)),
          cub_bytes};
}

// Bytes that the steps of cub need, one after the other, for the points that are kept out of
// `num_found`.
size_t CubBytes(int count, int num_found) {
  const SiftFound* found = nullptr;
  SiftFound* kept = nullptr;
  uint32_t* scale = nullptr;
  uint64_t* place = nullptr;
  int32_t* index = nullptr;
  size_t select = 0, by_scale = 0, by_place = 0, sum = 0;
  cub::DeviceSelect::If(nullptr, select, found, kept, index, num_found, IsKept{0});
  cub::DeviceRadixSort::SortPairs(nullptr, by_scale, scale, scale, index, index, count);
  cub::DeviceRadixSort::SortPairs(nullptr, by_place, place, place, index, index, count);
  cub::DeviceScan::ExclusiveSum(nullptr, sum, index, index, count + 1);
  return std::max({select, by_scale, by_place, sum});
}

// Sorts the points by y, x and scale.
cudaError_t SortPoints(const KeptPoints& kept, int count, cudaStream_t stream) {
  const int num_blocks = NumBlocks(count, kBlock);
  ScaleKeyKernel<<<num_blocks, kBlock, 0, stream>>>(kept.points, count, kept.scale_keys,
                                                    kept.index);
  size_t bytes = kept.cub_bytes;
  cudaError_t error =
      cub::DeviceRadixSort::SortPairs(kept.cub, bytes, kept.scale_keys, kept.other_scale_keys,
                                      kept.index, kept.other_index, count, 0, 32, stream);
  if (error != cudaSuccess) return error;
  PlaceKeyKernel<<<num_blocks, kBlock, 0, stream>>>(kept.points, count, kept.other_index,
                                                    kept.place_keys);
  error = cub::DeviceRadixSort::SortPairs(kept.cub, bytes, kept.place_keys, kept.other_place_keys,
                                          kept.other_index, kept.index, count, 0, 64, stream);
  if (error != cudaSuccess) return error;
  GatherKernel<<<num_blocks, kBlock, 0, stream>>>(kept.points, count, kept.index, kept.sorted);
  return cudaGetLastError();
}

// Words of octaves, one after another.
std::vector<OctaveWords> WordsOf(std::span<const SiftOctave> octaves, int first_index) {
  std::vector<OctaveWords> words;
  int64_t first = 0;
  for (size_t k = 0; k < octaves.size(); ++k) {
    words.push_back(
        {octaves[k], first_index + static_cast<int>(k), NumBlocks(octaves[k].width, 32), first});
    first += words.back().count();
  }
  return words;
}

}  // namespace

// Finds the points of octaves [first, end) and adds their numbers to `counts`. Returns the number
// of extrema, which are in scratch->points[which].
int CudaBackend::FindSiftPoints(const ExtractSiftArgs& args, const SiftSearch& search) {
  const auto [octaves, first, end, which, counts] = search;
  const std::span<SiftOctave> own = octaves.subspan(first, end - first);
  Buffer<float>& levels = which == 0 ? args.scratch->levels : args.scratch->finest;
  if (own.empty() || !levels.Reserve(*this, SiftLevelFloats(own))) return 0;
  PlaceSiftOctaves(levels.span().data, own);
  const std::vector<OctaveWords> words_of = WordsOf(own, first);
  // One more word, which is 0: its place is the number of extrema.
  const int64_t num_words = words_of.back().first + words_of.back().count();
  size_t cub_bytes = 0;
  const auto take = [&](Arena& arena) {
    return std::tuple(arena.Take<uint32_t>(num_words + 1), arena.Take<int32_t>(num_words + 1),
                      arena.Take<int32_t>(kNumScales), arena.Take<float>(own.front().plane()),
                      arena.Take<std::byte>(static_cast<int64_t>(cub_bytes)));
  };
  cub::DeviceScan::ExclusiveSum(nullptr, cub_bytes, WordBits(nullptr, NumBits()),
                                static_cast<int32_t*>(nullptr), num_words + 1);
  Arena sizes;
  take(sizes);
  Arena arena(Temporary(sizes.num_bytes()));
  const auto [words, places, device_counts, plane, cub] = take(arena);
  if (!error_.empty()) return 0;
  for (int k = first; k < end; ++k) {
    Keep(BuildSiftOctave({args.grey.data, k, octaves, plane, stream_}), "blurring");
    Launched("sift octave");
  }
  Zero(words + num_words, sizeof(uint32_t));
  Zero(device_counts, kNumScales * sizeof(int32_t));
  for (const OctaveWords& p : words_of) {
    const dim3 grid(p.per_row, NumBlocks(p.octave.height, kSearchBlockY));
    SearchKernel<<<grid, dim3(32, kSearchBlockY), 0, stream_>>>(p, words);
    Launched("sift search");
  }
  Keep(cub::DeviceScan::ExclusiveSum(cub, cub_bytes, WordBits(words, NumBits()), places,
                                     num_words + 1, stream_),
       "counting extrema");
  int32_t num_extrema = 0;
  CopyToHost(&num_extrema, places + num_words, sizeof(num_extrema));
  Buffer<std::byte>& points = args.scratch->points[which];
  if (!error_.empty() || num_extrema == 0 ||
      !points.Reserve(*this, num_extrema * static_cast<int64_t>(sizeof(SiftFound)))) {
    return 0;
  }
  auto* found = reinterpret_cast<SiftFound*>(points.span().data);
  for (const OctaveWords& p : words_of) {
    RefineKernel<<<NumBlocks(p.count(), kBlock), kBlock, 0, stream_>>>(
        {p, words, places, args.ignore.empty() ? nullptr : args.ignore.data, args.width,
         args.height, found, device_counts});
    Launched("sift refine");
  }
  std::array<int32_t, kNumScales> host_counts = {};
  CopyToHost(host_counts.data(), device_counts, sizeof(host_counts));
  for (int k = 0; k < kNumScales; ++k) counts[k] += host_counts[k];
  return num_extrema;
}

// Selects the points from scale `finest` on, sorts them and writes their features.
void CudaBackend::DescribeSiftPoints(const ExtractSiftArgs& args, const SiftSelection& selection) {
  const int count = selection.count;
  const int num_found = std::max(selection.num_found[0], selection.num_found[1]);
  const size_t cub_bytes = CubBytes(count, num_found);
  Arena sizes;
  TakeKeptPoints(sizes, count, cub_bytes);
  Arena arena(Temporary(sizes.num_bytes()));
  KeptPoints kept = TakeKeptPoints(arena, count, cub_bytes);
  if (!error_.empty()) return;
  // Coarser octaves first. Their number is known, so nothing waits between the two selections.
  SiftFound* next = kept.points;
  for (int which = 0; which < 2; ++which) {
    if (selection.num_found[which] == 0) continue;
    const auto* found = reinterpret_cast<const SiftFound*>(args.scratch->points[which].span().data);
    Keep(cub::DeviceSelect::If(kept.cub, kept.cub_bytes, found, next, kept.num_selected,
                               selection.num_found[which], IsKept{selection.finest}, stream_),
         "selecting points");
    next += selection.num_coarser;
  }
  Keep(SortPoints(kept, count, stream_), "sorting points");
  Launched("sift sort");
  SiftPyramid pyramid = {};
  std::copy(selection.octaves.begin(), selection.octaves.end(), pyramid.octaves);
  LaunchSiftDirections(pyramid, kept.sorted, count, kept.angles, kept.num_angles, stream_);
  Launched("sift directions");
  Keep(cub::DeviceScan::ExclusiveSum(kept.cub, kept.cub_bytes, kept.num_angles, kept.first,
                                     count + 1, stream_),
       "counting directions");
  int32_t num_features = 0;
  CopyToHost(&num_features, kept.first + count, sizeof(num_features));
  if (!error_.empty() || !args.keypoints->Reserve(*this, num_features) ||
      !args.descriptors->Reserve(*this, int64_t{num_features} * kSiftDescriptorSize)) {
    return;
  }
  LaunchSiftDescriptors({pyramid, kept.sorted, kept.angles, kept.first, count,
                         args.keypoints->span().data, args.descriptors->span().data},
                        stream_);
  Launched("sift descriptors");
}

void CudaBackend::ExtractSift(const ExtractSiftArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  std::vector<SiftOctave> octaves = SiftOctaves(args.width, args.height);
  const int num_octaves = static_cast<int>(octaves.size());
  std::vector<int64_t> counts(kNumScales);
  SiftSelection selection = {};
  selection.num_found[0] =
      FindSiftPoints(args, {octaves, std::min(1, num_octaves), num_octaves, 0, counts});
  const int64_t num_coarser = std::accumulate(counts.begin(), counts.end(), int64_t{0});
  if (num_octaves > 0 && num_coarser <= args.max_features) {
    selection.num_found[1] = FindSiftPoints(args, {octaves, 0, 1, 1, counts});
  }
  if (!error_.empty()) return;
  selection.octaves = octaves;
  selection.finest = FirstSiftScale(counts, args.max_features);
  selection.count = static_cast<int>(
      std::accumulate(counts.begin() + selection.finest, counts.end(), int64_t{0}));
  selection.num_coarser = static_cast<int>(std::accumulate(
      counts.begin() + std::max(selection.finest, kSiftStep), counts.end(), int64_t{0}));
  if (selection.count > 0) return DescribeSiftPoints(args, selection);
  args.keypoints->Reserve(*this, 0);
  args.descriptors->Reserve(*this, 0);
}

}  // namespace pepeseg
