#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/tree_work.cuh"
#include "kernels/math/reach.h"

// Squared distances between all pairs of points of 32 channels, for SpanningTree: the lists of
// nearest neighbours, and scans for the least edge to another component.
//
// A block owns 32 points as rows and goes through columns, 128 at a time: NearestKernel through all
// points, ScanKernel through its share of them (blockIdx.y). Both are in shared memory (Points); a
// warp owns 8 of the rows, a lane one column of each 32. LoadColumns replaces the columns; it
// starts and ends with __syncthreads. A distance is summed by one thread, channel by channel
// (kernels/math/reach.h), so that it is the same in both kernels and bitwise symmetric.
//
// NearestKernel: each warp keeps a sorted list for each of its rows, an element a lane; the ballot
// lists candidates, which are inserted in the order of their index, by shuffles. ScanKernel: each
// lane keeps the least key of each row, shuffles find that of the warp, and an integer atomic
// minimum that of all blocks. Neither depends on the order of blocks: results are the same in every
// run.

namespace pepeseg {
namespace {

constexpr int kWarps = 4, kBlock = 32 * kWarps;
constexpr int kRows = 8, kBlockRows = kRows * kWarps;
constexpr int kTile = 128;   // columns in shared memory
constexpr int kStride = 36;  // floats a column: 16-byte reads of eight lanes meet different banks
constexpr int kQuads = kFeatureSize / 4;
constexpr int kScanColumns = 8 * kTile;  // columns of a block of ScanKernel
constexpr unsigned kAllLanes = 0xffffffffu;

// Shared memory: rows of a block, and the present columns.
struct Points {
  float4 row[kBlockRows][kQuads];
  alignas(16) float column[kTile][kStride];
};

__device__ float4 QuadOf(const float* points, int point, int quad) {
  return reinterpret_cast<const float4*>(points)[int64_t{point} * kQuads + quad];
}

// Loads the columns from `first` on; zeros beyond the last point. Called by all threads.
__device__ void LoadColumns(const float* points, int first, int num_points, Points& shared) {
  __syncthreads();  // no thread reads the columns before any longer
  for (int i = static_cast<int>(threadIdx.x); i < kTile * kQuads; i += kBlock) {
    const int column = i / kQuads, quad = i % kQuads;
    const float4 value = first + column < num_points ? QuadOf(points, first + column, quad)
                                                     : make_float4(0, 0, 0, 0);
    *reinterpret_cast<float4*>(&shared.column[column][4 * quad]) = value;
  }
  __syncthreads();
}

// Squared distances of the warp's rows to a lane's column.
__device__ void SquaredDistances(const Points& shared, int warp, int column,
                                 float (&squared)[kRows]) {
#pragma unroll
  for (int i = 0; i < kRows; ++i) squared[i] = 0;
#pragma unroll
  for (int quad = 0; quad < kQuads; ++quad) {
    const float4 c = *reinterpret_cast<const float4*>(&shared.column[column][4 * quad]);
#pragma unroll
    for (int i = 0; i < kRows; ++i) {
      const float4 r = shared.row[warp * kRows + i][quad];
      squared[i] = AddSquare(c.x, r.x, squared[i]);
      squared[i] = AddSquare(c.y, r.y, squared[i]);
      squared[i] = AddSquare(c.z, r.z, squared[i]);
      squared[i] = AddSquare(c.w, r.w, squared[i]);
    }
  }
}

// Nearest points of a row, ascending, one a lane. Lanes from num_nearest on hold points that have
// dropped out.
struct List {
  float squared = INFINITY;
  int32_t point = -1;
  float farthest = INFINITY;  // largest of the first num_nearest; the same in all lanes
};
// Inserts a point behind those that are as near, and moves the farther ones up a lane. Called by a
// whole warp with the same point.
__device__ void Insert(float squared, int32_t point, int num_nearest, List& list) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const float before = __shfl_up_sync(kAllLanes, list.squared, 1);
  const int32_t point_before = __shfl_up_sync(kAllLanes, list.point, 1);
  if (list.squared > squared) {
    const bool here = lane == 0 || !(before > squared);
    list.squared = here ? squared : before;
    list.point = here ? point : point_before;
  }
  list.farthest = __shfl_sync(kAllLanes, list.squared, num_nearest - 1);
}

// A distance that is NaN or infinite is never below `farthest` and is not listed.
__global__ void __launch_bounds__(kBlock) NearestKernel(NearestParams p) {
  __shared__ Points shared;
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int first_row = static_cast<int>(blockIdx.x) * kBlockRows;
  // Rows beyond the last point repeat it, so that all threads reach the barriers; they are not
  // written.
  for (int i = static_cast<int>(threadIdx.x); i < kBlockRows * kQuads; i += kBlock) {
    const int row = min(first_row + i / kQuads, p.num_points - 1);
    shared.row[i / kQuads][i % kQuads] = QuadOf(p.points, row, i % kQuads);
  }
  List list[kRows];
  for (int tile = 0; tile < p.num_points; tile += kTile) {
    LoadColumns(p.points, tile, p.num_points, shared);
    for (int first = 0; first < kTile; first += 32) {
      float squared[kRows];
      SquaredDistances(shared, warp, first + lane, squared);
      const int column = tile + first + lane;
#pragma unroll
      for (int i = 0; i < kRows; ++i) {
        const bool other = column < p.num_points && column != first_row + warp * kRows + i;
        unsigned nearer = __ballot_sync(kAllLanes, other && squared[i] < list[i].farthest);
        for (; nearer != 0; nearer &= nearer - 1) {
          const int from = __ffs(static_cast<int>(nearer)) - 1;
          const float candidate = __shfl_sync(kAllLanes, squared[i], from);
          if (!(candidate < list[i].farthest)) continue;  // the same for all lanes
          Insert(candidate, tile + first + from, p.num_nearest, list[i]);
        }
      }
    }
  }
#pragma unroll
  for (int i = 0; i < kRows; ++i) {
    const int row = first_row + warp * kRows + i;
    if (row >= p.num_points) continue;
    if (lane < p.num_nearest) {
      p.squared[int64_t{row} * p.num_nearest + lane] = list[i].squared;
      p.point[int64_t{row} * p.num_nearest + lane] = list[i].point;
    }
    if (lane == max(p.min_samples - 2, 0)) p.core[row] = p.min_samples == 1 ? 0 : list[i].squared;
  }
}

// Shared memory of ScanKernel: the points, and index, component and core distance of each row.
struct ScanShared {
  Points points;
  int32_t row[kBlockRows], row_component[kBlockRows];
  float row_core[kBlockRows];
};

// Lowers `least` of the block's rows by what it finds in its columns. The grid is for n rows,
// because the host does not know num_rows; blocks beyond it return at once.
__global__ void __launch_bounds__(kBlock) ScanKernel(ScanParams p) {
  __shared__ ScanShared shared;
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  const int first_row = static_cast<int>(blockIdx.x) * kBlockRows;
  const int num_rows = *p.num_rows;
  if (first_row >= num_rows) return;
  if (threadIdx.x < kBlockRows) {
    const int32_t row = p.row[min(first_row + static_cast<int>(threadIdx.x), num_rows - 1)];
    shared.row[threadIdx.x] = row;
    shared.row_component[threadIdx.x] = p.component[row];
    shared.row_core[threadIdx.x] = p.core[row];
  }
  __syncthreads();
  for (int i = static_cast<int>(threadIdx.x); i < kBlockRows * kQuads; i += kBlock) {
    shared.points.row[i / kQuads][i % kQuads] =
        QuadOf(p.points, shared.row[i / kQuads], i % kQuads);
  }
  EdgeKey least[kRows];
#pragma unroll
  for (int i = 0; i < kRows; ++i) least[i] = kNoEdge;
  const int begin = static_cast<int>(blockIdx.y) * kScanColumns;
  const int end = min(begin + kScanColumns, p.num_points);
  for (int tile = begin; tile < end; tile += kTile) {
    LoadColumns(p.points, tile, p.num_points, shared.points);
    for (int first = 0; first < kTile; first += 32) {
      // Keeps the compiler from reading all rows ahead of the loop, which takes too many registers.
      __syncwarp();
      float squared[kRows];
      SquaredDistances(shared.points, warp, first + lane, squared);
      const int column = tile + first + lane;
      if (column >= end) continue;
      const int32_t component = p.component[column];
      const float core = p.core[column];
#pragma unroll
      for (int i = 0; i < kRows; ++i) {
        const int row = warp * kRows + i;
        if (component == shared.row_component[row]) continue;
        const float reach = MutualReach(squared[i], core, shared.row_core[row]);
        const EdgeKey key = static_cast<EdgeKey>(__float_as_uint(reach)) << 32 | column;
        least[i] = key < least[i] ? key : least[i];
      }
    }
  }
#pragma unroll
  for (int i = 0; i < kRows; ++i) {
    for (int offset = 16; offset > 0; offset /= 2) {
      const EdgeKey other = __shfl_xor_sync(kAllLanes, least[i], offset);
      least[i] = other < least[i] ? other : least[i];
    }
    // Rows beyond the last one repeat it, which does not change the minimum.
    if (lane == i && least[i] != kNoEdge) {
      atomicMin(reinterpret_cast<unsigned long long*>(p.least + shared.row[warp * kRows + i]),
                static_cast<unsigned long long>(least[i]));
    }
  }
}

}  // namespace

void LaunchNearest(const NearestParams& params, cudaStream_t stream) {
  NearestKernel<<<NumBlocks(params.num_points, kBlockRows), kBlock, 0, stream>>>(params);
}

void LaunchScan(const ScanParams& params, cudaStream_t stream) {
  const dim3 grid(NumBlocks(params.num_points, kBlockRows),
                  NumBlocks(params.num_points, kScanColumns));
  ScanKernel<<<grid, kBlock, 0, stream>>>(params);
}

}  // namespace pepeseg
