#include <cuda_runtime.h>
#include <thrust/iterator/counting_iterator.h>

#include <algorithm>
#include <bit>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_select.cuh>

#include "kernels/cuda/arena.h"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/fit.h"
#include "kernels/cuda/groups.cuh"
#include "kernels/cuda/launch.h"

// TransposeRows (TransposeRowsArgs in kernels/ops/feature.h): the entries of sparse rows, grouped
// by Gaussian, so that the backward pass gathers and needs no atomics. Launches, ordered by the
// stream:
//   ListKernel    a warp has a row, a lane every 32nd of its entries: lists the key (group,
//                 Gaussian) and the value (row, weight)
//   radix sort    of the pairs by key, by cub; stable, so that rows ascend within a column
//   selection     of the first entry of each key, by cub: where the columns begin
//   ColumnKernel  thread i unpacks entry i, and column i if there are as many
// Threads share nothing. The sort is stable and its input has a fixed order, so columns are the
// same in every run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;

// The value of an entry in the sort: its row, within its group, above the bits of its weight.
using RowAndWeight = uint64_t;

// Groups of rows that are transposed separately, on the device.
struct Groups {
  DeviceSpan<const int32_t> first;  // [groups + 1] rows
  int32_t num_gaussians;
};

// The key of a Gaussian in group k is k * num_gaussians + its index. `begin` is the first entry of
// the first group.
__global__ void __launch_bounds__(kBlock)
    ListKernel(RowSpan rows, Groups groups, int32_t begin, int32_t* key, RowAndWeight* value) {
  const int64_t row = groups.first.data[0] + (int64_t{blockIdx.x} * kBlock + threadIdx.x) / 32;
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

__global__ void __launch_bounds__(kBlock) ColumnKernel(ColumnParams p) {
  const int i = static_cast<int>(blockIdx.x) * kBlock + static_cast<int>(threadIdx.x);
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
  ListKernel<<<NumBlocks(entries.num_rows * 32, kBlock), kBlock, 0, stream>>>(
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
  ColumnKernel<<<NumBlocks(entries.count, kBlock), kBlock, 0, stream>>>(
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
