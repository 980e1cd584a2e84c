#include <cuda_runtime.h>
#include <thrust/iterator/counting_iterator.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>
#include <cub/device/device_select.cuh>

#include "kernels/buffer.h"
#include "kernels/cuda/blend_tile.cuh"
#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/cuda_backend.h"

// Sparse rows and columns over Gaussians (kernels/ops/rows.h; METHOD.md section 3, "Rows").
//
// CaptureRows: the Gaussians that are blended at sampled pixels, with their weights. RowKernel runs
// twice, first to count the entries of each row, then, after a running sum by cub and a wait of the
// host that sizes the outputs, to store them.
//
// One warp per pixel, one lane per entry of its tile. A block is four such warps, which share
// nothing. Shuffles make the running product of 1 - alpha over the lanes, which is the
// transmittance before each entry, and the ballot of the lanes that blend gives the place of each
// in the row. Both runs must decide alike, or a row would overrun its place: they execute the same
// code on the same entries.
//
// Every row is written by one warp in the order of the entries, and sums over lanes are a fixed
// tree: rows are the same in every run. Weights may differ from those of Render in the last bits,
// because the products associate differently.
//
// TransposeRows: the entries of sparse rows, grouped by Gaussian, so that the backward pass gathers
// and needs no atomics. Launches, ordered by the stream:
//   ListKernel    one warp per row, every 32nd of its entries per lane: lists the key (group,
//                 Gaussian) and the value (row, weight)
//   radix sort    of the pairs by key, by cub; stable, so that rows ascend within a column
//   selection     of the first entry of each key, by cub: where the columns begin
//   ColumnKernel  thread i unpacks entry i, and column i if there are as many
// Threads share nothing. The sort is stable and its input has a fixed order, so columns are the
// same in every run.

namespace pepeseg {
namespace {

// Sets the size as Buffer::Reserve does, but allocates without slack: for rows and columns, of
// which there are many and whose sizes do not change. Contents are lost when the buffer grows.
template <class T>
void Fit(Backend& backend, int64_t size, Buffer<T>& buffer) {
  if (size > buffer.capacity()) buffer = Buffer<T>(backend, size);
  buffer.Resize(size);
}

constexpr int kCaptureBlock = 128;

struct RowParams {
  TileView tiles;
  const int32_t* entry_visible;
  const int32_t* visible_gaussian;
  const int32_t* pixel_last_entry;
  bool inverse_depth;
  const int32_t* pixels;
  int64_t num_pixels;
  int32_t* row_first;  // [S + 1]; the first run writes the number of entries of row i to place i
  int32_t* entry_gaussian;
  float* entry_weight;
  float *pixel_alpha, *pixel_depth;  // may be null
};

// kStore: the second run, with row_first known.
template <bool kStore>
__global__ void __launch_bounds__(kCaptureBlock) RowKernel(RowParams p) {
  const int64_t row = (int64_t{blockIdx.x} * kCaptureBlock + threadIdx.x) / 32;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  if (row >= p.num_pixels) return;
  const int32_t pixel = p.pixels[row];
  const int x = pixel % p.tiles.width, y = pixel / p.tiles.width;
  const int32_t first =
      p.tiles.tile_first_entry[y / kTileSize * p.tiles.num_tiles_x + x / kTileSize];
  const int32_t end = first + p.pixel_last_entry[pixel];
  int32_t next = kStore ? p.row_first[row] : 0;
  float transmittance = 1, alpha_sum = 0, depth_sum = 0;
  for (int32_t base = first; base < end; base += 32) {
    float alpha = 0, depth = 0;
    int32_t visible = 0;
    if (base + lane < end) {
      visible = p.entry_visible[base + lane];
      const SplatWords s = LoadSplat(p.tiles.splats, visible);
      alpha = SplatAlpha(s, x + 0.5f, y + 0.5f);
      depth = p.inverse_depth ? InverseDepth(s.c.y) : s.c.y;
    }
    const uint32_t blended = __ballot_sync(kAllLanes, alpha > 0);
    // Transmittance behind the group's splats up to and including this lane's, alone.
    float passed = BlendStep(alpha, 1.0f).transmittance;
    for (int offset = 1; offset < 32; offset *= 2) {
      const float other = __shfl_up_sync(kAllLanes, passed, offset);
      if (lane >= offset) passed *= other;
    }
    float before = __shfl_up_sync(kAllLanes, passed, 1);
    if (lane == 0) before = 1;
    const float weight = BlendStep(alpha, transmittance).weight * before;
    transmittance *= __shfl_sync(kAllLanes, passed, 31);
    if (kStore && alpha > 0) {
      const int32_t at = next + __popc(blended & ((1u << lane) - 1));
      p.entry_gaussian[at] = p.visible_gaussian[visible];
      p.entry_weight[at] = weight;
    }
    next += __popc(blended);
    alpha_sum += weight;
    depth_sum += weight * depth;
  }
  if constexpr (!kStore) {
    if (lane == 0) p.row_first[row] = next;
    return;
  }
  for (int offset = 16; offset > 0; offset /= 2) {
    alpha_sum += __shfl_xor_sync(kAllLanes, alpha_sum, offset);
    depth_sum += __shfl_xor_sync(kAllLanes, depth_sum, offset);
  }
  if (lane != 0) return;
  if (p.pixel_alpha != nullptr) p.pixel_alpha[row] = alpha_sum;
  if (p.pixel_depth != nullptr) p.pixel_depth[row] = depth_sum;
}

}  // namespace

// The host waits once, for the number of entries.
void CudaBackend::CaptureRows(const CaptureRowsArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  const RenderScratch& scratch = *args.scratch;
  const int64_t num_pixels = args.pixels.size;
  args.row_first->Reserve(*this, num_pixels + 1);
  int32_t* row_first = args.row_first->span().data;
  size_t scan_bytes = 0;
  cub::DeviceScan::ExclusiveSum(nullptr, scan_bytes, row_first, num_pixels + 1, stream_);
  void* temporary = Temporary(scan_bytes);
  if (!error_.empty()) return;
  args.row_first->Zero();
  RowParams params = {TilesOf(scratch),
                      scratch.entry_visible.span().data,
                      scratch.visible_gaussian.span().data,
                      scratch.pixel_last_entry.span().data,
                      scratch.inverse_depth,
                      args.pixels.data,
                      num_pixels,
                      row_first,
                      nullptr,
                      nullptr,
                      args.pixel_alpha.data,
                      args.pixel_depth.data};
  const int num_blocks = NumBlocks(num_pixels * 32, kCaptureBlock);
  if (num_blocks > 0) RowKernel<false><<<num_blocks, kCaptureBlock, 0, stream_>>>(params);
  Launched("count rows");
  Keep(cub::DeviceScan::ExclusiveSum(temporary, scan_bytes, row_first, num_pixels + 1, stream_),
       "summing the rows");
  Launched("sum rows");
  int32_t num_entries = 0;
  CopyToHost(&num_entries, row_first + num_pixels, sizeof(num_entries));
  if (!error_.empty()) return;
  Fit(*this, num_entries, *args.entry_gaussian);
  Fit(*this, num_entries, *args.entry_weight);
  if (!error_.empty() || num_blocks == 0) return;
  params.entry_gaussian = args.entry_gaussian->span().data;
  params.entry_weight = args.entry_weight->span().data;
  RowKernel<true><<<num_blocks, kCaptureBlock, 0, stream_>>>(params);
  Launched("store rows");
}

namespace {

constexpr int kTransposeBlock = 256;

// The value of an entry in the sort: its row, within its group, above the bits of its weight.
using RowAndWeight = uint64_t;

// Groups of rows that are transposed separately, on the device.
struct Groups {
  DeviceSpan<const int32_t> first;  // [groups + 1] rows
  int32_t num_gaussians;
};

// The key of a Gaussian in group k is k * num_gaussians + its index. `begin` is the first entry of
// the first group.
__global__ void __launch_bounds__(kTransposeBlock)
    ListKernel(RowSpan rows, Groups groups, int32_t begin, int32_t* key, RowAndWeight* value) {
  const int64_t row =
      groups.first.data[0] + (int64_t{blockIdx.x} * kTransposeBlock + threadIdx.x) / 32;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  if (row >= groups.first.data[groups.first.size - 1]) return;
  const int group = GroupOf(groups.first, row);
  const uint64_t number = row - groups.first.data[group];
  for (int32_t e = rows.first.data[row] + lane; e < rows.first.data[row + 1]; e += 32) {
    const float weight = rows.weight.size == 0 ? 1.0f : rows.weight.data[e];
    key[e - begin] = group * groups.num_gaussians + rows.gaussian.data[e];
    value[e - begin] = number << 32 | __float_as_uint(weight);
  }
}

// Returns whether a sorted entry is the first of its column.
struct IsFirst {
  const int32_t* key;
  __device__ bool operator()(int32_t i) const { return i == 0 || key[i] != key[i - 1]; }
};
using Places = thrust::counting_iterator<int32_t>;

struct ColumnParams {
  Groups groups;
  const int32_t* key;  // [count] sorted
  const RowAndWeight* value;
  const int32_t* num_touched;
  int count;
  int32_t* group_column;  // [groups + 1]
  int32_t *column_gaussian, *first, *pixel;
  float* weight;  // or null
};

// Writes the Gaussian of a column and, if the column is the first of its group, where that group
// begins. Groups before it without a column begin there as well; the last column ends the groups
// after its own.
__device__ void PlaceColumn(const ColumnParams& p, int column, int num_touched) {
  const int32_t num_gaussians = p.groups.num_gaussians, key = p.key[p.first[column]];
  p.column_gaussian[column] = key % num_gaussians;
  const int group = key / num_gaussians;
  const int before = column == 0 ? -1 : p.key[p.first[column - 1]] / num_gaussians;
  for (int g = before + 1; g <= group; ++g) p.group_column[g] = column;
  if (column + 1 < num_touched) return;
  for (int g = group + 1; g < p.groups.first.size; ++g) p.group_column[g] = num_touched;
}

__global__ void __launch_bounds__(kTransposeBlock) ColumnKernel(ColumnParams p) {
  const int i = static_cast<int>(blockIdx.x) * kTransposeBlock + static_cast<int>(threadIdx.x);
  if (i >= p.count) return;
  p.pixel[i] = static_cast<int32_t>(p.value[i] >> 32);
  if (p.weight != nullptr) p.weight[i] = __uint_as_float(static_cast<uint32_t>(p.value[i]));
  const int32_t num_touched = *p.num_touched;
  if (i < num_touched) PlaceColumn(p, i, num_touched);
  if (i == 0) p.first[num_touched] = p.count;
}

struct TransposeScratch {
  int32_t *group_first, *group_column;      // [groups + 1]
  int32_t *column_gaussian, *column_first;  // [entries], [entries + 1]; upper bounds
  int32_t *key, *other_key;                 // [entries]
  RowAndWeight *value, *other_value;
  int32_t* num_touched;  // [1]
  std::byte* cub;
  size_t cub_bytes;
};
TransposeScratch TakeScratch(Arena& arena, int num_groups, int count, size_t cub_bytes) {
  return {arena.Take<int32_t>(num_groups + 1),
          arena.Take<int32_t>(num_groups + 1),
          arena.Take<int32_t>(count),
          arena.Take<int32_t>(count + 1),
          arena.Take<int32_t>(count),
          arena.Take<int32_t>(count),
          arena.Take<RowAndWeight>(count),
          arena.Take<RowAndWeight>(count),
          arena.Take<int32_t>(1),
          arena.Take<std::byte>(static_cast<int64_t>(cub_bytes)),
          cub_bytes};
}

// Bytes that the sort and the selection need, one after the other.
size_t CubBytes(int count, int num_bits) {
  cub::DoubleBuffer<int32_t> keys;
  cub::DoubleBuffer<RowAndWeight> values;
  int32_t* none = nullptr;
  size_t sort = 0, select = 0;
  cub::DeviceRadixSort::SortPairs(nullptr, sort, keys, values, count, 0, num_bits);
  cub::DeviceSelect::If(nullptr, select, Places(0), none, none, count, IsFirst{none});
  return std::max(sort, select);
}

// The entries to be transposed.
struct Entries {
  RowSpan rows;
  Groups groups;
  int64_t num_rows;
  int32_t begin;
  int count, num_bits;  // number of entries; bits of a key
};
// Lists and sorts the entries, and unpacks them into the outputs and the scratch. Returns the first
// error of the launches.
cudaError_t SortByGaussian(const Entries& entries, const TransposeRowsArgs& args,
                           TransposeScratch& scratch, cudaStream_t stream) {
  ListKernel<<<NumBlocks(entries.num_rows * 32, kTransposeBlock), kTransposeBlock, 0, stream>>>(
      entries.rows, entries.groups, entries.begin, scratch.key, scratch.value);
  cub::DoubleBuffer<int32_t> keys(scratch.key, scratch.other_key);
  cub::DoubleBuffer<RowAndWeight> values(scratch.value, scratch.other_value);
  const cudaError_t sorted = cub::DeviceRadixSort::SortPairs(
      scratch.cub, scratch.cub_bytes, keys, values, entries.count, 0, entries.num_bits, stream);
  if (sorted != cudaSuccess) return sorted;
  const cudaError_t selected =
      cub::DeviceSelect::If(scratch.cub, scratch.cub_bytes, Places(0), scratch.column_first,
                            scratch.num_touched, entries.count, IsFirst{keys.Current()}, stream);
  if (selected != cudaSuccess) return selected;
  ColumnKernel<<<NumBlocks(entries.count, kTransposeBlock), kTransposeBlock, 0, stream>>>(
      {entries.groups, keys.Current(), values.Current(), scratch.num_touched, entries.count,
       scratch.group_column, scratch.column_gaussian, scratch.column_first, args.pixel->span().data,
       args.rows.weight.size == 0 ? nullptr : args.weight->span().data});
  return cudaGetLastError();
}

std::vector<int32_t> GroupsOf(const TransposeRowsArgs& args) {
  if (!args.group_first.empty()) return {args.group_first.begin(), args.group_first.end()};
  return {0, static_cast<int32_t>(args.rows.first.size - 1)};
}

}  // namespace

// The host waits for the number of entries and for that of columns, to size the outputs.
void CudaBackend::TransposeRows(const TransposeRowsArgs& args) {
  const Turn turn(*this);
  if (!turn || args.rows.first.size < 1) return;
  const std::vector<int32_t> group_first = GroupsOf(args);
  const auto num_groups = static_cast<int64_t>(group_first.size()) - 1;
  const int64_t num_keys = num_groups * args.num_gaussians;
  if (num_keys >= int64_t{1} << 31) {
    return Fail({"TransposeRows: " + std::to_string(num_groups) + " groups of " +
                 std::to_string(args.num_gaussians) +
                 " Gaussians: the product must be below 2^31"});
  }
  int32_t begin = 0, end = 0, num_touched = 0;
  CopyToHost(&begin, args.rows.first.data + group_first.front(), sizeof(begin));
  CopyToHost(&end, args.rows.first.data + group_first.back(), sizeof(end));
  const int count = end - begin;
  Fit(*this, count, *args.pixel);
  if (args.rows.weight.size != 0) Fit(*this, count, *args.weight);
  const int num_bits = std::bit_width(static_cast<uint64_t>(std::max<int64_t>(num_keys - 1, 1)));
  const size_t cub_bytes = CubBytes(count, num_bits);
  const auto take = [&](Arena& arena) {
    return TakeScratch(arena, static_cast<int>(num_groups), count, cub_bytes);
  };
  Arena sizes;
  take(sizes);
  Arena arena(Temporary(sizes.num_bytes()));
  TransposeScratch scratch = take(arena);
  if (!error_.empty()) return;
  if (args.group_column != nullptr) args.group_column->assign(group_first.size(), 0);
  if (count == 0) {
    Fit(*this, 0, *args.gaussian);
    Fit(*this, 1, *args.first);
    return args.first->Zero();
  }

  CopyFromHost(scratch.group_first, group_first.data(), group_first.size() * sizeof(int32_t));
  const Groups groups = {{scratch.group_first, num_groups + 1},
                         static_cast<int32_t>(args.num_gaussians)};
  const int64_t num_rows = group_first.back() - group_first.front();
  Keep(
      SortByGaussian({args.rows, groups, num_rows, begin, count, num_bits}, args, scratch, stream_),
      "sorting the row entries");
  Launched("transpose rows");
  if (args.group_column != nullptr) {
    CopyToHost(args.group_column->data(), scratch.group_column,
               group_first.size() * sizeof(int32_t));
  }
  CopyToHost(&num_touched, scratch.num_touched, sizeof(num_touched));
  if (!error_.empty()) return;
  Fit(*this, num_touched, *args.gaussian);
  Fit(*this, num_touched + 1, *args.first);
  if (!error_.empty()) return;
  Copy(args.gaussian->span().data, scratch.column_gaussian, num_touched * sizeof(int32_t));
  Copy(args.first->span().data, scratch.column_first, (num_touched + 1) * sizeof(int32_t));
}

}  // namespace pepeseg
