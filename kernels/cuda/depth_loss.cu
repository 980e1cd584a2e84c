#include <cuda_runtime.h>

#include <algorithm>
#include <cub/block/block_scan.cuh>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/math/depth.h"

// DepthLoss (DepthLossArgs in kernels/ops/render.h; METHOD.md section 1, "Depth"; formulas in
// kernels/math/depth.h). Launches, ordered by the stream:
//   GatherKernel    Dhat of each pixel, and its moments with the prior summed by block
//   FitKernel       one block: the sums of the blocks, and the fit of the view and of the rectangle
//   RowSumsKernel   windows only; one block per scanline: running sums of the moments along it
//   CompareKernel   one thread per column of 16 scanlines: residuals and gradients
//   StoreSumsKernel one block: the sums of the errors of all blocks
// The host waits for nothing: each kernel reads from the device whether the view carries a fit.
//
// A window's moments are the difference of two running sums for each of its scanlines; a thread of
// CompareKernel moves its window down, adding a scanline and removing one. That makes the work of a
// pixel independent of the radius, except that each band of 16 scanlines starts with 2 radius of
// them.
//
// Moments are summed in double, as variances cancel. Sums over a block are a tree in shared memory
// with __syncthreads between its levels, whose order depends on the size of the block alone, and
// there are no atomics: results are the same in every run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
constexpr int kPixelsPerThread = 4;  // in GatherKernel
constexpr int kColumns = 128;        // columns of a block of CompareKernel, one a thread
constexpr int kBandRows = 16;        // scanlines of a block of CompareKernel

using Moments = DepthMoments<double>;
constexpr int kNumMoments = 5;
static_assert(sizeof(Moments) == kNumMoments * sizeof(double));

// Moments over all pixels that count, and over those in the rectangle.
struct ViewMoments {
  Moments view, patch;
};
// Sums of absolute residuals, not weighted.
struct Errors {
  double view, local;
};
__device__ ViewMoments operator+(const ViewMoments& a, const ViewMoments& b) {
  return {a.view + b.view, a.patch + b.patch};
}
__device__ Errors operator+(const Errors& a, const Errors& b) {
  return {a.view + b.view, a.local + b.local};
}

struct DepthParams {
  int width, height;
  const float *alpha, *depth, *prior;
  const uint8_t* ignore;  // may be null
  float min_alpha, min_prior, max_prior, view_weight, local_weight;
  bool in_windows;
  int radius;
  PixelBox patch;
  float* x;               // [H, W] Dhat; NaN where the pixel does not count
  Moments* row_sums;      // [H, W] over the scanline up to and including the pixel; windows only
  ViewMoments* gathered;  // [blocks of GatherKernel]
  Errors* errors;         // [blocks of CompareKernel]
  DepthFit* fit;
  double* pixel_count;
  float *alpha_grad, *depth_grad;
  double* sums;
};

__device__ bool IsInside(const PixelBox& box, int x, int y) {
  return x >= box.x && x < box.x + box.width && y >= box.y && y < box.y + box.height;
}

// Returns the block's sum in thread 0 and zeros in all others, which would otherwise read it while
// thread 0 still writes. T is a struct of sums with operator+. Called by all threads, once a
// kernel.
template <class T, int kThreads>
__device__ T SumOverBlock(const T& own) {
  __shared__ T threads[kThreads];
  threads[threadIdx.x] = own;
  for (int half = kThreads / 2; half > 0; half /= 2) {
    __syncthreads();
    if (static_cast<int>(threadIdx.x) < half) {
      threads[threadIdx.x] = threads[threadIdx.x] + threads[threadIdx.x + half];
    }
  }
  return threadIdx.x == 0 ? threads[0] : T{};
}
// Sums an array, by one block of kBlock threads: each adds every kBlock-th element, then the block.
template <class T>
__device__ T SumOfMemory(const T* values, int count) {
  T own = {};
  for (int i = static_cast<int>(threadIdx.x); i < count; i += kBlock) own = own + values[i];
  return SumOverBlock<T, kBlock>(own);
}

// Writes x, and the moments of the pixels that count by block.
__global__ void __launch_bounds__(kBlock) GatherKernel(DepthParams p) {
  const int64_t num_pixels = int64_t{p.width} * p.height;
  ViewMoments own = {};
#pragma unroll
  for (int k = 0; k < kPixelsPerThread; ++k) {
    const int64_t i = (int64_t{blockIdx.x} * kPixelsPerThread + k) * kBlock + threadIdx.x;
    if (i >= num_pixels) break;
    const float alpha = p.alpha[i], prior = p.prior[i];
    const bool counts = alpha > p.min_alpha && p.min_prior <= prior && prior <= p.max_prior &&
                        (p.ignore == nullptr || p.ignore[i] == 0);
    const float x = counts ? NormalizedDepth(p.depth[i], alpha) : __int_as_float(0x7fc00000);
    p.x[i] = x;
    if (!counts) continue;
    const auto moments = DepthMomentsOf<double>(x, prior);
    own.view = own.view + moments;
    const int row = static_cast<int>(i / p.width);
    const int column = static_cast<int>(i - int64_t{row} * p.width);
    if (IsInside(p.patch, column, row)) own.patch = own.patch + moments;
  }
  const ViewMoments sum = SumOverBlock<ViewMoments, kBlock>(own);
  if (threadIdx.x == 0) p.gathered[blockIdx.x] = sum;
}

// One block. Thread 0 writes the fit.
__global__ void __launch_bounds__(kBlock) FitKernel(DepthParams p, int num_gathered) {
  const ViewMoments all = SumOfMemory(p.gathered, num_gathered);
  if (threadIdx.x != 0) return;
  *p.fit = FitDepth(all.view, p.in_windows ? all.view : all.patch, p.view_weight, p.local_weight);
  *p.pixel_count = p.fit->usable ? all.view.count : 0;
}

struct AddMoments {
  __device__ Moments operator()(const Moments& a, const Moments& b) const { return a + b; }
};

// Running sums of the moments along scanline blockIdx.x, 256 pixels at a time. The barrier at the
// end of the loop lets the scan reuse its shared memory.
__global__ void __launch_bounds__(kBlock) RowSumsKernel(DepthParams p) {
  using Scan = cub::BlockScan<Moments, kBlock>;
  __shared__ typename Scan::TempStorage storage;
  if (!p.fit->usable) return;
  const int64_t row = int64_t{blockIdx.x} * p.width;
  Moments before = {};
  for (int base = 0; base < p.width; base += kBlock) {
    const int column = base + static_cast<int>(threadIdx.x);
    Moments own = {};
    if (column < p.width && p.x[row + column] == p.x[row + column]) {
      own = DepthMomentsOf<double>(p.x[row + column], p.prior[row + column]);
    }
    Moments sum, total;
    Scan(storage).InclusiveScan(own, sum, AddMoments(), total);
    if (column < p.width) p.row_sums[row + column] = before + sum;
    before = before + total;
    __syncthreads();
  }
}

// Moments of the part of a scanline that lies in the window around a column. Zeros outside the
// image.
__device__ Moments RowOfWindow(const DepthParams& p, int column, int row) {
  if (row < 0 || row >= p.height) return {};
  const Moments* sums = p.row_sums + int64_t{row} * p.width;
  const Moments upto = sums[min(column + p.radius, p.width - 1)];
  return column > p.radius ? upto - sums[column - p.radius - 1] : upto;
}

// Writes the gradients of a pixel that counts and adds its errors.
__device__ void ComparePixel(const DepthParams& p, const DepthFit& fit, int64_t i,
                             const ScaleShift<float>& local, float local_grad, Errors& errors) {
  const auto compared = CompareDepth(fit, local, local_grad, p.x[i], p.prior[i]);
  const auto grad = NormalizedDepthVjp(p.x[i], p.alpha[i], compared.grad);
  p.depth_grad[i] = grad.depth_sum;
  p.alpha_grad[i] = grad.alpha;
  errors.view += compared.view_error;
  errors.local += compared.local_error;
}

__device__ void ClearPixel(const DepthParams& p, int64_t i) {
  p.depth_grad[i] = p.alpha_grad[i] = 0;
}

// Goes down one column of a band of scanlines, from `first` on. `window` holds the moments of the
// window around the present scanline.
template <bool kInWindows>
__device__ Errors CompareColumn(const DepthParams& p, const DepthFit& fit, int column, int first) {
  Errors errors = {};
  Moments window = {};
  if constexpr (kInWindows) {
    for (int row = first - p.radius; row < first + p.radius; ++row) {
      window = window + RowOfWindow(p, column, row);
    }
  }
  for (int row = first; row < min(first + kBandRows, p.height); ++row) {
    const int64_t i = int64_t{row} * p.width + column;
    const bool counts = p.x[i] == p.x[i];
    if (!counts) ClearPixel(p, i);
    if constexpr (kInWindows) {
      window = window + RowOfWindow(p, column, row + p.radius);
      if (counts) {
        const auto local = FitWindow<double>(window, fit.variance_floor);
        ComparePixel(p, fit, i, {static_cast<float>(local.scale), static_cast<float>(local.shift)},
                     fit.local_grad, errors);
      }
      window = window - RowOfWindow(p, column, row - p.radius);
    } else if (counts) {
      const bool inside = IsInside(p.patch, column, row);
      ComparePixel(p, fit, i, fit.patch, inside ? fit.local_grad : 0.0f, errors);
    }
  }
  return errors;
}

// All threads reach SumOverBlock, also those beyond the image. Without a fit all gradients are 0.
template <bool kInWindows>
__global__ void __launch_bounds__(kColumns) CompareKernel(DepthParams p) {
  const int column = static_cast<int>(blockIdx.x) * kColumns + threadIdx.x;
  const int first = static_cast<int>(blockIdx.y) * kBandRows;
  const DepthFit fit = *p.fit;
  Errors errors = {};
  if (column < p.width && fit.usable) errors = CompareColumn<kInWindows>(p, fit, column, first);
  if (column < p.width && !fit.usable) {
    for (int row = first; row < min(first + kBandRows, p.height); ++row) {
      ClearPixel(p, int64_t{row} * p.width + column);
    }
  }
  const Errors sum = SumOverBlock<Errors, kColumns>(errors);
  if (threadIdx.x == 0) p.errors[blockIdx.y * gridDim.x + blockIdx.x] = sum;
}

// One block. Without a fit, errors, weights and counts are 0.
__global__ void __launch_bounds__(kBlock) StoreSumsKernel(DepthParams p, int num_errors) {
  const Errors all = SumOfMemory(p.errors, num_errors);
  if (threadIdx.x != 0) return;
  p.sums[kSumDepthView] = p.fit->view_grad * all.view;
  p.sums[kSumDepthLocal] = p.fit->local_grad * all.local;
  p.sums[kSumDepthPixels] = *p.pixel_count;
  p.sums[kDepthScale] = p.fit->view.scale;
  p.sums[kDepthShift] = p.fit->view.shift;
  p.sums[kDepthSkipped] = p.fit->usable ? 0 : 1;
}

// Offsets of arrays in one block of memory, each a multiple of 16 bytes.
class Layout {
 public:
  // Returns the offset of the next array.
  size_t Add(int64_t num_bytes) {
    const size_t at = size_;
    size_ += (static_cast<size_t>(num_bytes) + 15) / 16 * 16;
    return at;
  }
  size_t size() const { return size_; }

 private:
  size_t size_ = 0;
};

}  // namespace

void CudaBackend::DepthLoss(const DepthLossArgs& args) {
  const Turn turn(*this);
  const int64_t num_pixels = int64_t{args.width} * args.height;
  if (!turn || num_pixels == 0) return;
  const bool in_windows = args.local_form == DepthLocalForm::kWindows && args.local_weight > 0;
  const int num_gathered = NumBlocks(num_pixels, kBlock * kPixelsPerThread);
  const dim3 grid(NumBlocks(args.width, kColumns), NumBlocks(args.height, kBandRows));
  const auto num_errors = static_cast<int>(grid.x * grid.y);
  Layout layout;
  const size_t fit = layout.Add(sizeof(DepthFit)), pixel_count = layout.Add(sizeof(double));
  const size_t gathered = layout.Add(num_gathered * sizeof(ViewMoments));
  const size_t errors = layout.Add(num_errors * sizeof(Errors));
  const size_t x = layout.Add(num_pixels * sizeof(float));
  const size_t row_sums = layout.Add(in_windows ? num_pixels * sizeof(Moments) : 0);
  auto* memory = static_cast<std::byte*>(Temporary(layout.size()));
  if (!error_.empty()) return;
  const DepthParams params = {args.width,
                              args.height,
                              args.alpha.data,
                              args.depth.data,
                              args.prior.data,
                              args.ignore.data,
                              args.min_alpha,
                              args.min_prior,
                              args.max_prior,
                              args.view_weight,
                              args.local_weight,
                              in_windows,
                              args.window_radius,
                              args.patch,
                              reinterpret_cast<float*>(memory + x),
                              reinterpret_cast<Moments*>(memory + row_sums),
                              reinterpret_cast<ViewMoments*>(memory + gathered),
                              reinterpret_cast<Errors*>(memory + errors),
                              reinterpret_cast<DepthFit*>(memory + fit),
                              reinterpret_cast<double*>(memory + pixel_count),
                              args.alpha_grad.data,
                              args.depth_grad.data,
                              args.sums.data};
  GatherKernel<<<num_gathered, kBlock, 0, stream_>>>(params);
  Launched("gather depth");
  FitKernel<<<1, kBlock, 0, stream_>>>(params, num_gathered);
  Launched("fit depth");
  if (in_windows) {
    RowSumsKernel<<<args.height, kBlock, 0, stream_>>>(params);
    Launched("depth row sums");
    CompareKernel<true><<<grid, kColumns, 0, stream_>>>(params);
  } else {
    CompareKernel<false><<<grid, kColumns, 0, stream_>>>(params);
  }
  Launched("compare depth");
  StoreSumsKernel<<<1, kBlock, 0, stream_>>>(params, num_errors);
  Launched("depth sums");
}

}  // namespace pepeseg
