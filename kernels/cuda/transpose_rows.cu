#include <cuda_runtime.h>
#include <thrust/iterator/counting_iterator.h>

#include <algorithm>
#include <bit>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_select.cuh>

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

// Whether an entry is the first of its Gaussian, once they are sorted.
struct IsFirst {
  const int32_t* gaussian;
  __device__ bool operator()(int32_t i) const { return i == 0 || gaussian[i] != gaussian[i - 1]; }
};
using Places = thrust::counting_iterator<int32_t>;

struct ColumnParams {
  const int32_t* gaussian;  // [count] sorted
  const PixelAndWeight* value;
  const int32_t* num_touched;
  int count;
  int32_t *column_gaussian, *first, *pixel;
  float* weight;
};
__global__ void __launch_bounds__(kBlock) ColumnKernel(ColumnParams p) {
  const int i = static_cast<int>(blockIdx.x) * kBlock + static_cast<int>(threadIdx.x);
  if (i >= p.count) return;
  p.pixel[i] = static_cast<int32_t>(p.value[i] >> 32);
  p.weight[i] = __uint_as_float(static_cast<uint32_t>(p.value[i]));
  const int32_t num_touched = *p.num_touched;
  if (i < num_touched) p.column_gaussian[i] = p.gaussian[p.first[i]];
  if (i == 0) p.first[num_touched] = p.count;
}

struct TransposeScratch {
  int32_t *gaussian, *other_gaussian;  // [entries]
  PixelAndWeight *value, *other_value;
  int32_t* num_touched;  // [1]
  std::byte* cub;
  size_t cub_bytes;
};
TransposeScratch TakeScratch(Arena& arena, int count, size_t cub_bytes) {
  return {arena.Take<int32_t>(count),
          arena.Take<int32_t>(count),
          arena.Take<PixelAndWeight>(count),
          arena.Take<PixelAndWeight>(count),
          arena.Take<int32_t>(1),
          arena.Take<std::byte>(static_cast<int64_t>(cub_bytes)),
          cub_bytes};
}

int NumBits(int64_t num_gaussians) {
  return std::bit_width(static_cast<uint64_t>(std::max<int64_t>(num_gaussians - 1, 1)));
}

// What the sort and the selection need, one after the other.
size_t CubBytes(int count, int num_bits) {
  cub::DoubleBuffer<int32_t> gaussians;
  cub::DoubleBuffer<PixelAndWeight> values;
  int32_t* none = nullptr;
  size_t sort = 0, select = 0;
  cub::DeviceRadixSort::SortPairs(nullptr, sort, gaussians, values, count, 0, num_bits);
  cub::DeviceSelect::If(nullptr, select, Places(0), none, none, count, IsFirst{none});
  return std::max(sort, select);
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
  const cudaError_t selected = cub::DeviceSelect::If(
      scratch.cub, scratch.cub_bytes, Places(0), args.first->span().data, scratch.num_touched,
      entries.count, IsFirst{gaussians.Current()}, stream);
  if (selected != cudaSuccess) return selected;
  ColumnKernel<<<NumBlocks(entries.count, kBlock), kBlock, 0, stream>>>(
      {gaussians.Current(), values.Current(), scratch.num_touched, entries.count,
       args.gaussian->span().data, args.first->span().data, args.pixel->span().data,
       args.weight->span().data});
  return cudaGetLastError();
}

}  // namespace

// The host waits twice, for the number of entries and for that of the touched Gaussians.
void CudaBackend::TransposeRows(const TransposeRowsArgs& args) {
  const Turn turn(*this);
  const int64_t num_pixels = args.rows.first.size - 1;
  if (!turn || num_pixels < 0) return;
  auto* sizes_read = reinterpret_cast<int32_t*>(pinned_counters_);
  const auto read = [&](const int32_t* from, int place) {
    Keep(cudaMemcpyAsync(sizes_read + place, from, sizeof(*from), cudaMemcpyDeviceToHost, stream_),
         "reading the sizes of rows");
  };
  read(args.rows.first.data, 0);
  read(args.rows.first.data + num_pixels, 1);
  Keep(cudaStreamSynchronize(stream_), "waiting for the device");
  if (!error_.empty()) return;
  const int begin = sizes_read[0], count = sizes_read[1] - begin;
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
  Launched("transpose rows");
  read(scratch.num_touched, 0);
  Keep(cudaStreamSynchronize(stream_), "waiting for the device");
  if (!error_.empty()) return;
  const int64_t num_touched = sizes_read[0];
  args.gaussian->Resize(num_touched);
  args.first->Resize(num_touched + 1);
}

}  // namespace pepeseg
