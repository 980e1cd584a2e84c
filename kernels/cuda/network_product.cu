#include <cuda_runtime.h>

#include <algorithm>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/network_tile.cuh"
#include "kernels/math/activation.h"
#include "kernels/math/window.h"

// Linear and Convolve3x3 (kernels/ops/network.h).
//
// ProductKernel: a block owns kRows x kColumns of the output and runs over the inner dimension in
// steps of kStep. Its four warps own a quarter each, two down and two across. Tiles of both
// matrices go to shared memory by asynchronous copies, kStages steps ahead; the copies gather: rows
// of windows, or for each tap of a convolution the place it reads, with zeros outside. So one
// barrier a step suffices: before it a thread waits for its own copies of that step, and after it
// the buffer that was read last is overwritten. Where rows are normalised, a thread sums the values
// and squares of a row while they are in shared memory. At the end the sums go through shared
// memory, so that bias, residual, activation and stores work on 8 adjacent channels.
//
// A value is summed in the order of the inner dimension whatever the tile, so results do not depend
// on the number of rows.

namespace pepeseg {
namespace {

constexpr int kThreads = 128;
constexpr int kColumns = 64;
constexpr int kSumPitch = kColumns + 8;
constexpr int kStages = 3;

struct ProductParams {
  const void *input, *weights, *residual;
  void* output;
  const float *bias, *column_sums;  // null: none
  int rows, in, out;
  Activation activation;
  bool float_output;
  // Linear.
  bool normalize, gather, scatter;
  float epsilon;
  WindowGrid windows;
  // Convolve3x3: of the input, and of the output.
  int channels, height, width, out_height, out_width, stride;
};

// Where the rows that a thread copies come from.
struct LinearRow {
  int64_t at;  // index of the row's first value; -1: zeros
};
struct ConvolvedRow {
  int64_t at;  // index of the first value of the image; -1: zeros
  int y, x;    // place of the first tap
};

__device__ inline LinearRow RowAt(const ProductParams& p, int row, LinearRow /*kind*/) {
  if (row >= p.rows) return {-1};
  const int place = p.gather ? PlaceOfToken(p.windows, row) : row;
  return {place < 0 ? -1 : int64_t{place} * p.in};
}
__device__ inline ConvolvedRow RowAt(const ProductParams& p, int row, ConvolvedRow /*kind*/) {
  if (row >= p.rows) return {-1, 0, 0};
  const int scanline = row / p.out_width, image = scanline / p.out_height;
  return {int64_t{image} * p.height * p.width * p.channels,
          (scanline - image * p.out_height) * p.stride - 1,
          (row - scanline * p.out_width) * p.stride - 1};
}

// Index of value k of a row; -1: zeros.
__device__ inline int64_t ValueAt(const ProductParams& p, const LinearRow& row, int k) {
  return row.at < 0 || k >= p.in ? -1 : row.at + k;
}
__device__ inline int64_t ValueAt(const ProductParams& p, const ConvolvedRow& row, int k) {
  if (row.at < 0 || k >= p.in) return -1;
  const int tap = k / p.channels;
  const int y = row.y + tap / 3, x = row.x + tap % 3;
  if (y < 0 || y >= p.height || x < 0 || x >= p.width) return -1;
  return row.at + (int64_t{y} * p.width + x) * p.channels + (k - tap * p.channels);
}

// Copies of one step by a thread. It has the same rows in each step.
template <class T, int kRows, class Row>
struct TileLoader {
  using Tile = ProductTile<T, kRows, kColumns>;
  static constexpr int kLeftVectors = kStep / Tile::kVector;      // of a row
  static constexpr int kRightVectors = kColumns / Tile::kVector;  // of a row
  static constexpr int kLeftRows = kThreads / kLeftVectors;       // rows between a thread's rows
  static constexpr int kRightRows = kThreads / kRightVectors;
  static constexpr int kCount = kRows / kLeftRows;

  __device__ TileLoader(const ProductParams& p, int first_row, int first_column)
      : p_(p), column_(first_column) {
#pragma unroll
    for (int k = 0; k < kCount; ++k) {
      rows_[k] = RowAt(p, first_row + thread() / kLeftVectors + k * kLeftRows, Row());
    }
  }
  __device__ void Load(int step, Tile& tile) const {
    const int within = thread() % kLeftVectors * Tile::kVector;
    const T* input = static_cast<const T*>(p_.input);
#pragma unroll
    for (int k = 0; k < kCount; ++k) {
      const int64_t at = ValueAt(p_, rows_[k], step * kStep + within);
      CopyAsync(tile.left + (thread() / kLeftVectors + k * kLeftRows) * Tile::kLeftPitch + within,
                input + (at < 0 ? 0 : at), at >= 0);
    }
    const T* weights = static_cast<const T*>(p_.weights);
    const int across = thread() % kRightVectors * Tile::kVector;
#pragma unroll
    for (int k = 0; k < kStep; k += kRightRows) {
      const int row = step * kStep + k + thread() / kRightVectors;
      const bool inside = row < p_.in && column_ + across < p_.out;
      const int64_t at = int64_t{row} * p_.out + column_ + across;
      CopyAsync(tile.right + (k + thread() / kRightVectors) * Tile::kRightPitch + across,
                weights + (inside ? at : 0), inside);
    }
  }

 private:
  static __device__ int thread() { return static_cast<int>(threadIdx.x); }
  const ProductParams& p_;
  int column_;
  Row rows_[kCount];
};

// Sums of a row, less its first value, which keeps the squares small where the mean is large.
struct RowSums {
  float first = 0, sum = 0, squares = 0;

  template <class T>
  __device__ void Add(const T* values, int count, bool starts) {
    if (starts) first = static_cast<float>(values[0]);
    for (int k = 0; k < count; k += 8) {
      float some[8];
      LoadValues<8>(values + k, some);
#pragma unroll
      for (const float value : some) {
        const float x = value - first;
        sum += x;
        squares += x * x;
      }
    }
  }
};

// What the 8 channels of a thread need in each of its rows of the output.
struct ColumnValues {
  float bias[8] = {}, sums[8] = {};
};

// Activates 8 channels of a row of the output and stores them from index `at` on.
template <class T>
__device__ inline void StoreActivated(const ProductParams& p, float (&values)[8], int64_t at) {
  if (p.activation == Activation::kGelu) {
#pragma unroll
    for (float& value : values) value = Gelu(value);
  } else if (p.activation == Activation::kRelu) {
#pragma unroll
    for (float& value : values) value = fmaxf(value, 0.0f);
  }
  if (p.float_output) {
    StoreValues<8>(values, static_cast<float*>(p.output) + at);
  } else {
    StoreValues<8>(values, static_cast<T*>(p.output) + at);
  }
}

template <class T, int kRows>
union ProductMemory {
  ProductTile<T, kRows, kColumns> tiles[kStages];
  float sums[kRows * kSumPitch];
};

template <class T, int kRows, class Row>
__global__ void __launch_bounds__(kThreads) ProductKernel(const __grid_constant__ ProductParams p) {
  constexpr int kDown = kRows / 32, kAcross = kColumns / 16;  // parts of a warp's quarter
  extern __shared__ __align__(16) unsigned char bytes[];
  auto& memory = *reinterpret_cast<ProductMemory<T, kRows>*>(bytes);
  __shared__ float row_mean[kRows], row_scale[kRows];
  const int thread = static_cast<int>(threadIdx.x), warp = thread / 32, lane = thread % 32;
  const int first_row = static_cast<int>(blockIdx.y) * kRows;
  const int first_column = static_cast<int>(blockIdx.x) * kColumns;
  const int warp_row = warp / 2 * (kRows / 2), warp_column = warp % 2 * (kColumns / 2);
  const TileLoader<T, kRows, Row> loader(p, first_row, first_column);
  const int num_steps = (p.in + kStep - 1) / kStep;

  float sums[kDown][kAcross][4] = {};
  RowSums row_sums;
#pragma unroll
  for (int step = 0; step < kStages - 1; ++step) {
    if (step < num_steps) loader.Load(step, memory.tiles[step]);
    CommitCopies();
  }
  for (int step = 0; step < num_steps; ++step) {
    WaitForCopies<kStages - 2>();
    __syncthreads();
    const int ahead = step + kStages - 1;
    if (ahead < num_steps) loader.Load(ahead, memory.tiles[ahead % kStages]);
    CommitCopies();
    const auto& tile = memory.tiles[step % kStages];
    MultiplyTiles(tile, warp_row, warp_column, sums);
    if (p.normalize && thread < kRows) {
      row_sums.Add(tile.left + thread * tile.kLeftPitch, min(kStep, p.in - step * kStep),
                   step == 0);
    }
  }
  WaitForCopies<0>();
  __syncthreads();
#pragma unroll
  for (int m = 0; m < kDown; ++m) {
#pragma unroll
    for (int n = 0; n < kAcross; ++n) {
      float* at = memory.sums + (warp_row + m * 16 + lane / 4) * kSumPitch + warp_column + n * 8 +
                  lane % 4 * 2;
      *reinterpret_cast<float2*>(at) = {sums[m][n][0], sums[m][n][1]};
      *reinterpret_cast<float2*>(at + 8 * kSumPitch) = {sums[m][n][2], sums[m][n][3]};
    }
  }
  if (p.normalize && thread < kRows) {
    const float mean = row_sums.sum / p.in;
    row_mean[thread] = row_sums.first + mean;
    row_scale[thread] = rsqrtf(fmaxf(row_sums.squares / p.in - mean * mean, 0.0f) + p.epsilon);
  }
  __syncthreads();
  // A thread owns the same 8 channels of every 16th row, four of them at once, so that the loads of
  // residuals are under way together.
  const int within = thread % (kColumns / 8) * 8, column = first_column + within;
  if (column >= p.out) return;
  ColumnValues columns;
  if (p.bias != nullptr) LoadValues<8>(p.bias + column, columns.bias);
  if (p.normalize) LoadValues<8>(p.column_sums + column, columns.sums);
  constexpr int kApart = kThreads / (kColumns / 8), kAtOnce = 4;
  for (int first = thread / (kColumns / 8); first < kRows; first += kApart * kAtOnce) {
    float values[kAtOnce][8];
    int64_t at[kAtOnce];
#pragma unroll
    for (int k = 0; k < kAtOnce; ++k) {
      const int row = first + k * kApart;
      const bool inside = first_row + row < p.rows;
      const int to =
          inside && p.scatter ? PlaceOfToken(p.windows, first_row + row) : first_row + row;
      at[k] = inside && to >= 0 ? int64_t{to} * p.out + column : -1;
      if (at[k] >= 0 && p.residual != nullptr) {
        LoadValues<8>(static_cast<const T*>(p.residual) + at[k], values[k]);
      } else {
#pragma unroll
        for (float& value : values[k]) value = 0;
      }
    }
#pragma unroll
    for (int k = 0; k < kAtOnce; ++k) {
      const int row = first + k * kApart;
      const float mean = p.normalize ? row_mean[row] : 0;
      const float scale = p.normalize ? row_scale[row] : 1;
      float product[8];
      LoadValues<8>(memory.sums + row * kSumPitch + within, product);
#pragma unroll
      for (int c = 0; c < 8; ++c) {
        values[k][c] += (product[c] - mean * columns.sums[c]) * scale + columns.bias[c];
      }
      if (at[k] >= 0) StoreActivated<T>(p, values[k], at[k]);
    }
  }
}

template <class T, int kRows, class Row>
cudaError_t Launch(const ProductParams& p, cudaStream_t stream) {
  constexpr auto kKernel = ProductKernel<T, kRows, Row>;
  constexpr int kBytes = sizeof(ProductMemory<T, kRows>);
  const cudaError_t error =
      cudaFuncSetAttribute(kKernel, cudaFuncAttributeMaxDynamicSharedMemorySize, kBytes);
  if (error != cudaSuccess) return error;
  const dim3 blocks(NumBlocks(p.out, kColumns), NumBlocks(p.rows, kRows));
  kKernel<<<blocks, kThreads, kBytes, stream>>>(p);
  return cudaSuccess;
}

// Small tiles where large ones would not fill the device twice: 132 multiprocessors of an H100 or
// H200.
template <class T, class Row>
cudaError_t LaunchTiled(const ProductParams& p, cudaStream_t stream) {
  constexpr int kFull = 2 * 132;
  if (int64_t{NumBlocks(p.rows, 128)} * NumBlocks(p.out, kColumns) >= kFull) {
    return Launch<T, 128, Row>(p, stream);
  }
  return Launch<T, 64, Row>(p, stream);
}

template <class Row>
cudaError_t LaunchProduct(const ProductParams& p, Precision precision, cudaStream_t stream) {
  if (precision == Precision::kHalf) return LaunchTiled<__half, Row>(p, stream);
  return LaunchTiled<float, Row>(p, stream);
}

}  // namespace

void CudaBackend::Linear(const LinearArgs& args) {
  const Turn turn(*this);
  if (!turn || args.rows == 0) return;
  ProductParams p = {};
  p.input = args.input.data;
  p.weights = args.weights.data;
  p.residual = args.residual.data;
  p.output = args.output.data;
  p.bias = args.bias.data;
  p.column_sums = args.column_sums.data;
  p.rows = static_cast<int>(args.rows);
  p.in = args.in;
  p.out = args.out;
  p.activation = args.activation;
  p.float_output = args.output.precision == Precision::kFloat;
  p.normalize = args.normalize;
  p.gather = args.gather;
  p.scatter = args.scatter;
  p.epsilon = args.epsilon;
  p.windows = args.windows;
  Keep(LaunchProduct<LinearRow>(p, args.input.precision, stream_), "linear");
  Launched("linear");
}

void CudaBackend::Convolve3x3(const Convolve3x3Args& args) {
  const Turn turn(*this);
  if (!turn || args.num_images == 0) return;
  ProductParams p = {};
  p.input = args.input.data;
  p.weights = args.weights.data;
  p.output = args.output.data;
  p.bias = args.bias.data;
  p.out_height = ConvolvedExtent(args.height, args.stride);
  p.out_width = ConvolvedExtent(args.width, args.stride);
  p.rows = args.num_images * p.out_height * p.out_width;
  p.in = 9 * args.in;
  p.out = args.out;
  p.activation = args.activation;
  p.float_output = args.output.precision == Precision::kFloat;
  p.channels = args.in;
  p.height = args.height;
  p.width = args.width;
  p.stride = args.stride;
  Keep(LaunchProduct<ConvolvedRow>(p, args.input.precision, stream_), "convolve 3x3");
  Launched("convolve 3x3");
}

}  // namespace pepeseg
