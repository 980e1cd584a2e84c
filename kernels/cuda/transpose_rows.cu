#include <cuda_runtime.h>

#include <algorithm>
#include <bit>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_run_length_encode.cuh>
#include <cub/device/device_scan.cuh>

#include "kernels/cuda/arena.h"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/launch.h"

namespace pepeseg {
namespace {

constexpr int kBlock = 256;

// An entry on its way through the sort: the pixel above the bits of the weight.
using PixelAndWeight = uint64_t;

// A warp a pixel.
__global__ void __launch_bounds__(kBlock)
    ListKernel(RowSpan rows, int32_t begin, int32_t* gaussian, PixelAndWeight* value) {
  const int64_t pixel = (int64_t{blockIdx.x} * kBlock + threadIdx.x) / 32;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  if (pixel + 1 >= rows.first.size) return;
  for (int32_t e = rows.first.data[pixel] + lane; e < rows.first.data[pixel + 1]; e += 32) {
    gaussian[e - begin] = rows.gaussian.data[e];
    value[e - begin] = static_cast<uint64_t>(pixel) << 32 | __float_as_uint(rows.weight.data[e]);
  }
}

__global__ void __launch_bounds__(kBlock)
    SplitKernel(const PixelAndWeight* value, int count, int32_t* pixel, float* weight) {
  const int i = static_cast<int>(blockIdx.x) * kBlock + static_cast<int>(threadIdx.x);
  if (i >= count) return;
  pixel[i] = static_cast<int32_t>(value[i] >> 32);
  weight[i] = __uint_as_float(static_cast<uint32_t>(value[i]));
}

struct TransposeScratch {
  int32_t *gaussian, *other_gaussian;  // [entries]
  PixelAndWeight *value, *other_value;
  int32_t* count;        // [entries + 1] entries of a touched Gaussian
  int32_t* num_touched;  // [1]
  std::byte* cub;
  size_t cub_bytes;
};
TransposeScratch TakeScratch(Arena& arena, int count, size_t cub_bytes) {
  return {arena.Take<int32_t>(count),
          arena.Take<int32_t>(count),
          arena.Take<PixelAndWeight>(count),
          arena.Take<PixelAndWeight>(count),
          arena.Take<int32_t>(count + 1),
          arena.Take<int32_t>(1),
          arena.Take<std::byte>(static_cast<int64_t>(cub_bytes)),
          cub_bytes};
}

int NumBits(int64_t num_gaussians) {
  return std::bit_width(static_cast<uint64_t>(std::max<int64_t>(num_gaussians - 1, 1)));
}

// What the sort, the run lengths and their sum need, one after the other.
size_t CubBytes(int count, int num_bits) {
  cub::DoubleBuffer<int32_t> gaussians;
  cub::DoubleBuffer<PixelAndWeight> values;
  int32_t* none = nullptr;
  size_t sort = 0, runs = 0, sum = 0;
  cub::DeviceRadixSort::SortPairs(nullptr, sort, gaussians, values, count, 0, num_bits);
  cub::DeviceRunLengthEncode::Encode(nullptr, runs, none, none, none, none, count);
  cub::DeviceScan::ExclusiveSum(nullptr, sum, none, none, count + 1);
  return std::max({sort, runs, sum});
}

// An entry's Gaussian and the rest of it, sorted: stable, so that pixels stay ascending.
struct Entries {
  RowSpan rows;
  int32_t begin;
  int count, num_bits;  // of a Gaussian's index
};
cudaError_t SortByGaussian(const Entries& entries, const TransposeRowsArgs& args,
                           TransposeScratch& scratch, cudaStream_t stream) {
  const int64_t num_pixels = entries.rows.first.size - 1;
  ListKernel<<<NumBlocks(num_pixels * 32, kBlock), kBlock, 0, stream>>>(
      entries.rows, entries.begin, scratch.gaussian, scratch.value);
  cub::DoubleBuffer<int32_t> gaussians(scratch.gaussian, scratch.other_gaussian);
  cub::DoubleBuffer<PixelAndWeight> values(scratch.value, scratch.other_value);
  const cudaError_t sorted =
      cub::DeviceRadixSort::SortPairs(scratch.cub, scratch.cub_bytes, gaussians, values,
                                      entries.count, 0, entries.num_bits, stream);
  if (sorted != cudaSuccess) return sorted;
  SplitKernel<<<NumBlocks(entries.count, kBlock), kBlock, 0, stream>>>(
      values.Current(), entries.count, args.pixel->span().data, args.weight->span().data);
  return cub::DeviceRunLengthEncode::Encode(scratch.cub, scratch.cub_bytes, gaussians.Current(),
                                            args.gaussian->span().data, scratch.count,
                                            scratch.num_touched, entries.count, stream);
}

}  // namespace

// The host waits twice, for the number of entries and for that of the touched Gaussians.
void CudaBackend::TransposeRows(const TransposeRowsArgs& args) {
  const Turn turn(*this);
  const int64_t num_pixels = args.rows.first.size - 1;
  if (!turn || num_pixels < 0) return;
  int32_t begin = 0, end = 0;
  CopyToHost(&begin, args.rows.first.data, sizeof(begin));
  CopyToHost(&end, args.rows.first.data + num_pixels, sizeof(end));
  if (!error_.empty()) return;
  const int count = end - begin;
  args.gaussian->Reserve(*this, count);
  args.first->Reserve(*this, count + 1);
  args.pixel->Reserve(*this, count);
  args.weight->Reserve(*this, count);
  const Entries entries = {args.rows, begin, count, NumBits(args.num_gaussians)};
  const size_t cub_bytes = CubBytes(entries.count, entries.num_bits);
  Arena sizes;
  TakeScratch(sizes, count, cub_bytes);
  Arena arena(Temporary(sizes.num_bytes()));
  TransposeScratch scratch = TakeScratch(arena, count, cub_bytes);
  if (!error_.empty()) return;
  if (count == 0) return args.first->Zero();

  Keep(SortByGaussian(entries, args, scratch, stream_), "sorting the row entries");
  Launched("sort row entries");
  int32_t num_touched = 0;
  CopyToHost(&num_touched, scratch.num_touched, sizeof(num_touched));
  if (!error_.empty()) return;
  Keep(cub::DeviceScan::ExclusiveSum(scratch.cub, scratch.cub_bytes, scratch.count,
                                     args.first->span().data, num_touched + 1, stream_),
       "summing the columns");
  Launched("sum columns");
  args.gaussian->Resize(num_touched);
  args.first->Resize(num_touched + 1);
}

}  // namespace pepeseg
