#include <cuda_runtime.h>

#include <algorithm>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/device_planes.cuh"
#include "kernels/math/refine.h"

// RefineGaussians (RefineGaussiansArgs in kernels/ops/refine.h; METHOD.md section 1, "Refinement";
// formulas in kernels/math/refine.h). All kernels: one thread per visible Gaussian. Launches,
// ordered by the stream; the host waits for nothing:
//   RankKernel     key of each Gaussian: the gap to the rendered depth above its index
//   radix sort     of the keys by gap, by cub; the key at the candidate share is the limit
//   RefineKernel   Gaussians up to the limit: finds the crossing and shortens them
//   running sum    over the outside parts, by cub: their places in the output
//   CompactKernel  copies the outside parts there, in the order of their Gaussians
//
// A Gaussian is read and written by one thread. Counts are integer atomics, one a block
// (__syncthreads_count). Places come from a scan and equal gaps are ordered by index, so results
// are the same in every run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
constexpr uint64_t kNoCandidate = ~uint64_t{0};

struct RefineParams {
  // Outputs of the render. num_visible is an upper bound; the number is a counter on the device.
  const int32_t* visible_gaussian;
  const Splat* visible_splat;
  int64_t num_visible;
  Room room;
  const float *alpha, *depth;
  ProjectionCamera<float> camera;
  PatchMapView masks;
  double candidate_share;
  bool split;
  DevicePlanes<float> gaussians, moment1, moment2;
  int num_planes;
  int32_t* num_steps;
  int32_t* refinable;
  uint64_t* keys;           // [visible]
  uint64_t* sorted_keys;    // [visible]
  float* outside_shape;     // [6, visible]
  int32_t* has_outside;     // [visible]
  int32_t* outside_end;     // [visible] number of outside parts up to and including this Gaussian's
  int32_t* outside_source;  // [room_outside]
  float* outside_out;       // [6, room_outside]
  int64_t room_outside;
  int64_t* counts;
};

// Adds the number of threads of the block for which `counts` is true. Called by all threads.
__device__ void Count(int64_t* count, bool counts) {
  const int num = __syncthreads_count(counts);
  if (threadIdx.x == 0 && num > 0) {
    atomicAdd(reinterpret_cast<unsigned long long*>(count), static_cast<unsigned long long>(num));
  }
}

// Returns the sort key: the bits of the (non-negative) gap to the rendered depth in the high word,
// the index among the visible in the low word to break ties. kNoCandidate: not refinable, not in
// the image, or the pixel has no depth.
__device__ uint64_t CandidateKey(const RefineParams& p, int64_t visible) {
  if (visible >= p.room.counters[kNumVisible] || p.room.IsVoid()) return kNoCandidate;
  if (p.refinable[p.visible_gaussian[visible]] == 0) return kNoCandidate;
  const Splat splat = ToSplat(LoadSplat(p.visible_splat, static_cast<int32_t>(visible)));
  if (!(0 <= splat.x && splat.x < static_cast<float>(p.masks.width) && 0 <= splat.y &&
        splat.y < static_cast<float>(p.masks.height))) {
    return kNoCandidate;
  }
  const int64_t pixel =
      static_cast<int64_t>(splat.y) * p.masks.width + static_cast<int64_t>(splat.x);
  const float gap = DepthGap(p.alpha[pixel], p.depth[pixel], splat.depth);
  if (gap < 0) return kNoCandidate;
  return uint64_t{__float_as_uint(gap)} << 32 | static_cast<uint64_t>(visible);
}

__global__ void __launch_bounds__(kBlock) RankKernel(RefineParams p) {
  const int64_t visible = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  const uint64_t key = visible < p.num_visible ? CandidateKey(p, visible) : +kNoCandidate;
  if (visible < p.num_visible) p.keys[visible] = key;
  Count(p.counts + kNumRefineRanked, key != kNoCandidate);
}

// Read by all threads of RefineKernel, after RankKernel has counted.
__device__ int64_t NumCandidates(const RefineParams& p) {
  return static_cast<int64_t>(p.candidate_share * static_cast<double>(p.counts[kNumRefineRanked]));
}

// Writes mean and log scales to six planes, from `first` on.
__device__ void StoreShape(const GaussianShape<float>& shape, float* first, int64_t stride) {
  first[0 * stride] = shape.mean.x;
  first[1 * stride] = shape.mean.y;
  first[2 * stride] = shape.mean.z;
  first[3 * stride] = shape.log_scale.x;
  first[4 * stride] = shape.log_scale.y;
  first[5 * stride] = shape.log_scale.z;
}

// Shortens a candidate that crosses the border of a mask, resets its moments and step count, and
// stores the outside part, if one is wanted. Returns whether it was shortened.
__device__ bool RefineOne(const RefineParams& p, int64_t visible) {
  const int64_t i = p.visible_gaussian[visible];
  const DevicePlanes<const float> planes = {p.gaussians.data, p.gaussians.stride};
  const GaussianShape<float> shape = LoadShape(planes, i);
  const Refinement<float> refinement = FindRefinement(p.camera, shape, p.masks);
  if (!refinement.found) return false;
  StoreShape(PartOf(shape, refinement, false), p.gaussians.data + i, p.gaussians.stride);
  for (int k = 0; k < p.num_planes; ++k) p.moment1.At(k, i) = p.moment2.At(k, i) = 0;
  p.num_steps[i] = 0;
  p.refinable[i] = 0;
  if (p.split && HasOutsidePart(refinement)) {
    p.has_outside[visible] = 1;
    StoreShape(PartOf(shape, refinement, true), p.outside_shape + visible, p.num_visible);
  }
  return true;
}

// Candidates are the Gaussians whose key is not above that at the candidate share of the sorted
// keys.
__global__ void __launch_bounds__(kBlock) RefineKernel(RefineParams p) {
  const int64_t visible = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  const int64_t num_candidates = NumCandidates(p);
  if (visible == 0) p.counts[kNumRefineCandidates] = num_candidates;
  bool refined = false;
  if (visible < p.num_visible) {
    p.has_outside[visible] = 0;
    if (num_candidates > 0 && p.keys[visible] <= p.sorted_keys[num_candidates - 1]) {
      refined = RefineOne(p, visible);
    }
  }
  Count(p.counts + kNumRefined, refined);
}

// Copies the outside parts that fit the capacity, in the order of the visible, and counts them.
__global__ void __launch_bounds__(kBlock) CompactKernel(RefineParams p) {
  const int64_t visible = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (visible >= p.num_visible) return;
  const int64_t end = p.outside_end[visible];
  if (visible == p.num_visible - 1) p.counts[kNumRefineSplit] = min(end, p.room_outside);
  if (p.has_outside[visible] == 0 || end > p.room_outside) return;
  p.outside_source[end - 1] = p.visible_gaussian[visible];
  for (int k = 0; k < 6; ++k) {
    p.outside_out[k * p.room_outside + end - 1] = p.outside_shape[k * p.num_visible + visible];
  }
}

}  // namespace

void CudaBackend::RefineGaussians(const RefineGaussiansArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  Zero(args.counts.data, kNumRefineCounts * sizeof(int64_t));
  const int64_t num_visible = args.render->visible_splat.size();
  if (num_visible == 0 || args.masks.mask_area.empty()) return;
  RefineScratch& scratch = *args.scratch;
  scratch.keys.Reserve(*this, 2 * num_visible);
  scratch.outside_shape.Reserve(*this, 6 * num_visible);
  scratch.outside_position.Reserve(*this, 2 * num_visible);
  uint64_t* keys = scratch.keys.span().data;
  int32_t* has_outside = scratch.outside_position.span().data;
  const int num_keys = static_cast<int>(num_visible);
  size_t sort_bytes = 0, scan_bytes = 0;
  cub::DeviceRadixSort::SortKeys(nullptr, sort_bytes, keys, keys, num_keys, 32, 64, stream_);
  cub::DeviceScan::InclusiveSum(nullptr, scan_bytes, has_outside, has_outside, num_keys, stream_);
  void* temporary = Temporary(std::max(sort_bytes, scan_bytes));
  if (!error_.empty()) return;
  const RefineParams p = {args.render->visible_gaussian.span().data,
                          args.render->visible_splat.span().data,
                          num_visible,
                          RoomOf(*args.render),
                          args.alpha.data,
                          args.depth.data,
                          MakeProjectionCamera<float>(args.view),
                          MakePatchMapView(args.masks, args.view),
                          args.candidate_share,
                          args.split,
                          ToDevice(args.gaussians),
                          ToDevice(args.moment1),
                          ToDevice(args.moment2),
                          NumPlanes(args.gaussians.sh_degree),
                          args.num_steps.data,
                          args.refinable.data,
                          keys,
                          keys + num_visible,
                          scratch.outside_shape.span().data,
                          has_outside,
                          has_outside + num_visible,
                          args.outside_source.data,
                          args.outside_shape.data,
                          args.outside_source.size,
                          args.counts.data};
  const int num_blocks = NumBlocks(num_visible, kBlock);
  RankKernel<<<num_blocks, kBlock, 0, stream_>>>(p);
  Launched("rank candidates");
  // Only the gaps are sorted. The sort is stable, so equal gaps stay in the order of their index.
  Keep(cub::DeviceRadixSort::SortKeys(temporary, sort_bytes, p.keys, p.sorted_keys, num_keys, 32,
                                      64, stream_),
       "sorting the candidates");
  Launched("sort candidates");
  RefineKernel<<<num_blocks, kBlock, 0, stream_>>>(p);
  Launched("refine");
  Keep(cub::DeviceScan::InclusiveSum(temporary, scan_bytes, p.has_outside, p.outside_end, num_keys,
                                     stream_),
       "numbering the outside parts");
  Launched("number outside parts");
  CompactKernel<<<num_blocks, kBlock, 0, stream_>>>(p);
  Launched("compact outside parts");
}

}  // namespace pepeseg
