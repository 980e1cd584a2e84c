#include <cuda_runtime.h>

#include <algorithm>
#include <cmath>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/device_planes.cuh"
#include "kernels/math/density.h"

// Density control (kernels/ops/density.h; METHOD.md section 1, "Density"; formulas in
// kernels/math/density.h).
//
// PlanDensity: which Gaussians there are next, and where. Launches, ordered by the stream:
//   FateKernel         one thread per Gaussian: its fate; and the number of each fate
//   sort, LimitKernel  only if there is no space for all: one thread per Gaussian with one of
//                      the smallest keys, which is not densified
//   CountKernel, running sum
//                      one thread per Gaussian: where its descendants are listed
//   RowKernel          one thread per Gaussian: source, mean and log scales of its descendants
//   BoxKernel, MortonKernel, sort, OrderKernel
//                      one thread per descendant: Morton order of the means
//
// The host waits for the number of each fate, once or twice, as it has to size the outputs.
//
// Blocks share only integer atomics: counts (one a block, by __syncthreads_count), and the corners
// of the box as integers that order as the floats do (after a reduction over the warp). Sorts are
// stable and random numbers are hashes of seed and index, so results are the same in every run.
//
// GatherRows: copies the Gaussians that PlanDensity lists
// into new planes. One launch; one thread per Gaussian in one plane. Writes coalesce; reads do as
// far as neighbours in the new order were neighbours in the old one. Nothing is shared or summed.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
constexpr int kNumMoved = 6;  // planes in which a child may differ from its source: mean, log scale

__device__ int64_t ThreadIndex() { return int64_t{blockIdx.x} * kBlock + threadIdx.x; }

struct FateParams {
  DevicePlanes<const float> gaussians;
  int64_t count;
  const float *mean2d_grad_sum, *square_sum;
  const int32_t* num_visible;
  DensityBounds bounds;
  bool draws;  // see PlanDensityArgs
  uint32_t seed;
  // Outputs. The key of a Gaussian that is densified orders as its mean gradient or, if `draws`, as
  // its DrawKey; that of others is 0.
  DensityFate* fate;
  uint32_t* key;
  int32_t* index;
  unsigned long long* num_of_fate;  // [4]
};

// The division is the IEEE one, so that CPU and CUDA decide alike at the bound.
__global__ void __launch_bounds__(kBlock) FateKernel(FateParams p) {
  const int64_t i = ThreadIndex();
  DensityFate fate = kFatePruned;
  if (i < p.count) {
    const float largest =
        fmaxf(p.gaussians.At(kLogScalePlane, i),
              fmaxf(p.gaussians.At(kLogScalePlane + 1, i), p.gaussians.At(kLogScalePlane + 2, i)));
    const int32_t views = p.num_visible[i];
    const float gradient =
        views == 0 ? 0.0f : __fdiv_rn(p.mean2d_grad_sum[i], static_cast<float>(views));
    fate = FateOf(p.bounds, p.gaussians.At(kOpacityPlane, i), largest, gradient);
    p.fate[i] = fate;
    float key = gradient;
    if (p.draws) key = DrawKey(p.square_sum[i], p.seed, static_cast<uint32_t>(i));
    // The bits of floats that are not negative order as the floats do.
    p.key[i] = NumRowsOf(fate) == 2 ? __float_as_uint(key) + 1 : 0;
    p.index[i] = static_cast<int32_t>(i);
  }
  for (int f = kFatePruned; f <= kFateSplit; ++f) {
    const int num = __syncthreads_count(i < p.count && fate == f);
    if (threadIdx.x == 0 && num > 0) {
      atomicAdd(p.num_of_fate + f, static_cast<unsigned long long>(num));
    }
  }
}

// `index` is sorted by descending key. The Gaussians from place `room` on, which would be
// densified, are only kept.
__global__ void __launch_bounds__(kBlock)
    LimitKernel(const int32_t* index, int64_t room, int64_t num_densified, DensityFate* fate,
                unsigned long long* num_of_fate) {
  const int64_t k = room + ThreadIndex();
  if (k >= num_densified) return;
  const int32_t i = index[k];
  atomicAdd(num_of_fate + fate[i], ~0ull);  // one less
  fate[i] = kFateKept;
}

__global__ void __launch_bounds__(kBlock)
    CountKernel(const DensityFate* fate, int64_t count, int32_t* num_rows) {
  const int64_t i = ThreadIndex();
  if (i < count) num_rows[i] = NumRowsOf(fate[i]);
}

// The descendants of Gaussian i are rows first_row[i] and the next ones, in the order of i.
struct RowParams {
  DevicePlanes<const float> gaussians;
  int64_t count, num_rows;
  uint32_t seed;
  bool keeps_parent;
  const DensityFate* fate;
  const int32_t* first_row;
  int32_t* source;
  uint8_t* is_new;
  float* moved;  // [kNumMoved, num_rows]
};

__global__ void __launch_bounds__(kBlock) RowKernel(RowParams p) {
  const int64_t i = ThreadIndex();
  if (i >= p.count) return;
  const DensityFate fate = p.fate[i];
  const GaussianShape<float> shape = LoadShape(p.gaussians, i);
  for (int k = 0; k < NumRowsOf(fate); ++k) {
    Vec3<float> mean = shape.mean, log_scale = shape.log_scale;
    const bool is_child = fate == kFateSplit && (k > 0 || !p.keeps_parent);
    if (is_child) {
      mean = ChildMean(
          shape, NormalNumbers<float>(p.seed, static_cast<uint32_t>(i), static_cast<uint32_t>(k)));
      log_scale = log_scale - Vec3<float>{kLogSplitShrink, kLogSplitShrink, kLogSplitShrink};
    }
    const int64_t row = p.first_row[i] + k;
    p.source[row] = static_cast<int32_t>(i);
    p.is_new[row] = is_child || k > 0;
    const float moved[kNumMoved] = {mean.x, mean.y, mean.z, log_scale.x, log_scale.y, log_scale.z};
#pragma unroll
    for (int m = 0; m < kNumMoved; ++m) p.moved[m * p.num_rows + row] = moved[m];
  }
}

// Floats as integers that order as the floats do, and back.
__device__ int32_t ToOrdered(float x) {
  const int32_t bits = __float_as_int(x);
  return bits >= 0 ? bits : bits ^ 0x7fffffff;
}
__device__ float FromOrdered(int32_t bits) {
  return __int_as_float(bits >= 0 ? bits : bits ^ 0x7fffffff);
}

// Lowers and raises `box`, the smallest x, y, z and then the largest, as ordered integers. NaN
// takes no part. One atomic per warp and bound.
__global__ void __launch_bounds__(kBlock)
    BoxKernel(const float* moved, int64_t num_rows, int32_t* box) {
  const int64_t i = ThreadIndex();
  for (int axis = 0; axis < 3; ++axis) {
    const float value = i < num_rows ? moved[axis * num_rows + i] : NAN;
    const bool counts = value == value;
    const int32_t smallest = __reduce_min_sync(~0u, counts ? ToOrdered(value) : INT32_MAX);
    const int32_t largest = __reduce_max_sync(~0u, counts ? ToOrdered(value) : INT32_MIN);
    if (threadIdx.x % 32 != 0) continue;
    atomicMin(box + axis, smallest);
    atomicMax(box + 3 + axis, largest);
  }
}
__global__ void ResetBoxKernel(int32_t* box) {
  box[threadIdx.x] = threadIdx.x < 3 ? INT32_MAX : INT32_MIN;
}

__global__ void __launch_bounds__(kBlock)
    MortonKernel(const float* moved, int64_t num_rows, const int32_t* box, uint64_t* code,
                 int32_t* index) {
  const int64_t i = ThreadIndex();
  if (i >= num_rows) return;
  float min[3], max[3], place[3];
  for (int axis = 0; axis < 3; ++axis) {
    min[axis] = FromOrdered(box[axis]);
    max[axis] = FromOrdered(box[3 + axis]);
    place[axis] = moved[axis * num_rows + i];
  }
  code[i] = MortonCode(MakeMortonGrid(min, max), place);
  index[i] = static_cast<int32_t>(i);
}

struct OrderParams {
  int64_t num_rows;
  const int32_t* order;
  const int32_t* source;
  const uint8_t* is_new;
  const float* moved;
  int32_t* source_out;
  uint8_t* is_new_out;
  float* moved_out;
};
__global__ void __launch_bounds__(kBlock) OrderKernel(OrderParams p) {
  const int64_t i = ThreadIndex();
  if (i >= p.num_rows) return;
  const int32_t from = p.order[i];
  p.source_out[i] = p.source[from];
  p.is_new_out[i] = p.is_new[from];
#pragma unroll
  for (int m = 0; m < kNumMoved; ++m) {
    p.moved_out[m * p.num_rows + i] = p.moved[m * p.num_rows + from];
  }
}

// Keys and values of a radix sort, each with a second half to sort into.
template <class Key>
struct SortBuffers {
  SortBuffers(Backend& backend, int64_t count)
      : keys(backend, 2 * count), values(backend, 2 * count), count(count) {}
  cub::DoubleBuffer<Key> Keys() { return {keys.span().data, keys.span().data + count}; }
  cub::DoubleBuffer<int32_t> Values() { return {values.span().data, values.span().data + count}; }
  Buffer<Key> keys;
  Buffer<int32_t> values;
  int64_t count;
};

}  // namespace

// Writes the fates and returns the counts. num_rows is 0 after an error. The host waits.
DensityCounts CudaBackend::DecideFates(const PlanDensityArgs& args, DeviceSpan<uint8_t> fate) {
  const int64_t count = args.gaussians.count;
  SortBuffers<uint32_t> sort(*this, count);
  Buffer<unsigned long long> num_of_fate(*this, 4);
  if (!error_.empty()) return {};
  const DensityBounds bounds =
      MakeDensityBounds(args.min_gradient, args.clone_size, args.min_opacity, args.max_size);
  auto* fates = reinterpret_cast<DensityFate*>(fate.data);
  FateKernel<<<NumBlocks(count, kBlock), kBlock, 0, stream_>>>(
      {ToDevice(args.gaussians), count, args.mean2d_grad_sum.data, args.square_sum.data,
       args.num_visible.data, bounds, args.draws, args.seed, fates, sort.keys.span().data,
       sort.values.span().data, num_of_fate.span().data});
  Launched("density fates");
  unsigned long long num[4] = {};
  num_of_fate.Download(num);
  const auto num_densified = static_cast<int64_t>(num[kFateCloned] + num[kFateSplit]);
  const int64_t num_left = count - static_cast<int64_t>(num[kFatePruned]);
  const int64_t room = std::max<int64_t>(0, args.max_count - num_left);
  if (num_densified > room) {
    cub::DoubleBuffer<uint32_t> keys = sort.Keys();
    cub::DoubleBuffer<int32_t> index = sort.Values();
    size_t bytes = 0;
    const int num_items = static_cast<int>(count);
    cub::DeviceRadixSort::SortPairsDescending(nullptr, bytes, keys, index, num_items, 0, 32,
                                              stream_);
    void* temporary = Temporary(bytes);
    if (!error_.empty()) return {};
    Keep(cub::DeviceRadixSort::SortPairsDescending(temporary, bytes, keys, index, num_items, 0, 32,
                                                   stream_),
         "sorting the keys");
    LimitKernel<<<NumBlocks(num_densified - room, kBlock), kBlock, 0, stream_>>>(
        index.Current(), room, num_densified, fates, num_of_fate.span().data);
    Launched("density limit");
    num_of_fate.Download(num);
  }
  if (!error_.empty()) return {};
  const auto cloned = static_cast<int64_t>(num[kFateCloned]),
             split = static_cast<int64_t>(num[kFateSplit]);
  return {num_left + cloned + split, cloned, split, static_cast<int64_t>(num[kFatePruned])};
}

void CudaBackend::PlanDensity(const PlanDensityArgs& args) {
  const Turn turn(*this);
  *args.counts = {};
  const int64_t count = args.gaussians.count;
  if (!turn || count == 0) return;
  Buffer<uint8_t> fate(*this, count);
  Buffer<int32_t> num_rows_of(*this, count), first_row(*this, count);
  if (!error_.empty()) return;
  *args.counts = DecideFates(args, fate.span());
  const int64_t num_rows = args.counts->num_rows;
  args.source->Reserve(*this, num_rows);
  args.is_new->Reserve(*this, num_rows);
  args.mean_log_scale->Reserve(*this, kNumMoved * num_rows);
  if (num_rows == 0) return;
  Buffer<int32_t> source(*this, num_rows), box(*this, 6);
  Buffer<uint8_t> is_new(*this, num_rows);
  Buffer<float> moved(*this, kNumMoved * num_rows);
  SortBuffers<uint64_t> sort(*this, num_rows);
  if (!error_.empty()) return;

  const auto* fates = reinterpret_cast<const DensityFate*>(fate.span().data);
  const int num_blocks = NumBlocks(count, kBlock), num_row_blocks = NumBlocks(num_rows, kBlock);
  CountKernel<<<num_blocks, kBlock, 0, stream_>>>(fates, count, num_rows_of.span().data);
  size_t scan_bytes = 0, sort_bytes = 0;
  const int num_items = static_cast<int>(num_rows);
  cub::DoubleBuffer<uint64_t> codes = sort.Keys();
  cub::DoubleBuffer<int32_t> order = sort.Values();
  cub::DeviceScan::ExclusiveSum(nullptr, scan_bytes, num_rows_of.span().data, first_row.span().data,
                                static_cast<int>(count), stream_);
  cub::DeviceRadixSort::SortPairs(nullptr, sort_bytes, codes, order, num_items, 0, 3 * kMortonBits,
                                  stream_);
  void* temporary = Temporary(std::max(scan_bytes, sort_bytes));
  if (!error_.empty()) return;
  Keep(cub::DeviceScan::ExclusiveSum(temporary, scan_bytes, num_rows_of.span().data,
                                     first_row.span().data, static_cast<int>(count), stream_),
       "summing the rows");
  RowKernel<<<num_blocks, kBlock, 0, stream_>>>(
      {ToDevice(args.gaussians), count, num_rows, args.seed, args.keeps_parent, fates,
       first_row.span().data, source.span().data, is_new.span().data, moved.span().data});
  ResetBoxKernel<<<1, 6, 0, stream_>>>(box.span().data);
  BoxKernel<<<num_row_blocks, kBlock, 0, stream_>>>(moved.span().data, num_rows, box.span().data);
  MortonKernel<<<num_row_blocks, kBlock, 0, stream_>>>(moved.span().data, num_rows, box.span().data,
                                                       codes.Current(), order.Current());
  Keep(cub::DeviceRadixSort::SortPairs(temporary, sort_bytes, codes, order, num_items, 0,
                                       3 * kMortonBits, stream_),
       "sorting the rows");
  OrderKernel<<<num_row_blocks, kBlock, 0, stream_>>>(
      {num_rows, order.Current(), source.span().data, is_new.span().data, moved.span().data,
       args.source->span().data, args.is_new->span().data, args.mean_log_scale->span().data});
  Launched("density rows");
}

namespace {

struct GatherParams {
  const int32_t* source;
  const uint8_t* is_zero;  // may be null
  int64_t count;
  int num_planes;
  DevicePlanes<const float> from;
  DevicePlanes<float> to;
  const int32_t* number_from;
  int32_t* number_to;  // may be null
};

// blockIdx.y is the plane; the one after the last stands for `number`.
__global__ void __launch_bounds__(kBlock) GatherKernel(GatherParams p) {
  const int64_t i = int64_t{blockIdx.x} * kBlock + threadIdx.x;
  if (i >= p.count) return;
  const int plane = static_cast<int>(blockIdx.y);
  const int32_t row = p.source[i];
  const bool zero = p.is_zero != nullptr && p.is_zero[i] != 0;
  if (plane < p.num_planes) {
    p.to.At(plane, i) = zero ? 0.0f : p.from.At(plane, row);
  } else {
    p.number_to[i] = zero ? 0 : p.number_from[row];
  }
}

}  // namespace

void CudaBackend::GatherRows(const GatherRowsArgs& args) {
  const Turn turn(*this);
  if (!turn || args.to.count == 0) return;
  const int num_planes = NumPlanes(args.to.sh_degree);
  const int num_numbers = args.number_to.empty() ? 0 : 1;
  const dim3 grid(NumBlocks(args.to.count, kBlock), num_planes + num_numbers);
  GatherKernel<<<grid, kBlock, 0, stream_>>>({args.source.data, args.is_zero.data, args.to.count,
                                              num_planes, ToDevice(args.from), ToDevice(args.to),
                                              args.number_from.data, args.number_to.data});
  Launched("gather rows");
}

}  // namespace pepeseg
