#include <cuda_runtime.h>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/sift_windows.cuh"

// Directions and descriptors of SIFT: one warp per point, its lanes the pixels of the window about
// it. Each lane adds its pixels to a histogram of its own in shared memory, [bins][32 lanes], so
// that lanes never share a bank and no atomics are needed. Then each lane sums some bins over the
// histograms of all lanes, always in the same order. Warps share nothing.
//   DirectionKernel   windows of pixels; then the smoothed histogram, and its peaks by lane 0
//   DescriptorKernel  a point has one warp for each direction that it may have; windows are walked
//                     by scanlines, of which only the part within reach of the cells is read

namespace pepeseg {
namespace {

constexpr unsigned kAllLanes = ~0u;
constexpr int kLanes = 32;
constexpr int kDirectionWarps = 4, kDescriptorWarps = 2;

struct Gradient {
  float magnitude, angle;
};

// Gradient at a pixel: central differences, one-sided ones at the border.
__device__ Gradient GradientAt(const SiftOctave& octave, const float* level, int x, int y) {
  const float* here = level + y * octave.stride + x;
  const bool inner_x = x > 0 && x + 1 < octave.width, inner_y = y > 0 && y + 1 < octave.height;
  const float gx =
      (inner_x ? 0.5f : 1.0f) * (here[x + 1 < octave.width ? 1 : 0] - here[x > 0 ? -1 : 0]);
  const float gy = (inner_y ? 0.5f : 1.0f) * (here[y + 1 < octave.height ? octave.stride : 0] -
                                              here[y > 0 ? -octave.stride : 0]);
  return {Sqrt(gx * gx + gy * gy), Atan2(gy, gx)};
}

// Sums bin `bin` over the lanes. Each lane begins at another column, for the banks.
__device__ float SumOfLanes(const float (*histogram)[kLanes], int bin, int lane) {
  float sum = 0;
  for (int k = 0; k < kLanes; ++k) sum += histogram[bin][(lane + k) % kLanes];
  return sum;
}

// Adds the pixels of a window to the lane's histogram of directions.
__device__ void AddDirections(const SiftOctave& octave, const SiftPoint& point, int lane,
                              float (*histogram)[kLanes]) {
  const int radius = OrientationRadius(point.sigma);
  const int xi = static_cast<int>(point.x + 0.5f), yi = static_cast<int>(point.y + 0.5f);
  const int left = max(0, xi - radius), right = min(octave.width - 1, xi + radius);
  const int top = max(0, yi - radius), bottom = min(octave.height - 1, yi + radius);
  const float* level = octave.Row(point.level, 0);
  const float sigma = kOrientationSpread * point.sigma, scale = -0.5f / (sigma * sigma);
  const float limit = static_cast<float>(radius * radius) + 0.6f;
  const int width = right - left + 1, count = width * (bottom - top + 1);
  for (int i = lane; i < count; i += kLanes) {
    const int x = left + i % width, y = top + i / width;
    const float dx = static_cast<float>(x) - point.x, dy = static_cast<float>(y) - point.y;
    const float squared = dx * dx + dy * dy;
    if (squared >= limit) continue;
    const Gradient gradient = GradientAt(octave, level, x, y);
    const float weight = Exp(squared * scale) * gradient.magnitude;
    // Half a turn is added to keep the bin positive.
    const float bin = gradient.angle * (kOrientationBins / (2 * kPi)) + (kOrientationBins - 0.5f);
    const int k = static_cast<int>(bin);
    const float upper = weight * (bin - static_cast<float>(k));
    histogram[k % kOrientationBins][lane] += weight - upper;
    histogram[(k + 1) % kOrientationBins][lane] += upper;
  }
}

__device__ bool IsSamePoint(const SiftKeypoint& a, const SiftKeypoint& b) {
  return a.x == b.x && a.y == b.y && a.scale == b.scale;
}

__global__ void __launch_bounds__(kDirectionWarps* kLanes)
    DirectionKernel(SiftPyramid pyramid, const SiftFound* points, int count, SiftAngles* angles,
                    int32_t* num_angles) {
  __shared__ float histograms[kDirectionWarps][kOrientationBins][kLanes];
  __shared__ float smooths[kDirectionWarps][2][kOrientationBins];
  const int warp = static_cast<int>(threadIdx.x) / kLanes;
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const int i = static_cast<int>(blockIdx.x) * kDirectionWarps + warp;
  if (i >= count) return;
  float(*histogram)[kLanes] = histograms[warp];
  float(*smooth)[kOrientationBins] = smooths[warp];
  for (int k = 0; k < kOrientationBins; ++k) histogram[k][lane] = 0;
  const SiftFound point = points[i];
  AddDirections(pyramid.octaves[point.octave], point.in_octave, lane, histogram);
  __syncwarp();
  for (int k = lane; k < kOrientationBins; k += kLanes) {
    smooth[0][k] = SumOfLanes(histogram, k, lane);
  }
  for (int pass = 0; pass < kDirectionPasses; ++pass) {
    __syncwarp();
    for (int k = lane; k < kOrientationBins; k += kLanes) {
      smooth[1 - pass % 2][k] = SmoothedDirection(smooth[pass % 2], k);
    }
  }
  __syncwarp();
  if (lane != 0) return;
  const bool repeats = i > 0 && IsSamePoint(points[i - 1].keypoint, point.keypoint);
  num_angles[i] = repeats ? 0 : OrientationPeaks(smooth[0], angles[i].angle);
  if (i == count - 1) num_angles[count] = 0;
}

// The part of a scanline of a descriptor's window that lies in reach of its cells.
struct RowPart {
  float from, to;  // columns relative to the point

  // Narrows to the columns dx for which |a dx + b| < bound can hold.
  __device__ void Narrow(float a, float b, float bound) {
    if (a < 0) a = -a, b = -b;
    if (a < 1e-6f) return;
    from = fmaxf(from, (-bound - b) / a);
    to = fminf(to, (bound - b) / a);
  }
};

// Adds a value at a place among the cells, counted from the middle of the one before the first, to
// the two nearest cells along each side and the two nearest directions.
__device__ void AddToCells(float value, float cell_x, float cell_y, float bin, int lane,
                           float (*histogram)[kLanes]) {
  const int x = static_cast<int>(cell_x), y = static_cast<int>(cell_y);
  const int b = static_cast<int>(bin);
  const float right = cell_x - static_cast<float>(x), lower = cell_y - static_cast<float>(y);
  const float next = bin - static_cast<float>(b);
#pragma unroll
  for (int k = 0; k < 4; ++k) {
    const int to_x = x + k % 2 - 1, to_y = y + k / 2 - 1;
    if (to_x < 0 || to_x >= kDescriptorCells || to_y < 0 || to_y >= kDescriptorCells) continue;
    const float share = value * (k % 2 == 0 ? 1 - right : right) * (k / 2 == 0 ? 1 - lower : lower);
    const int cell = (to_y * kDescriptorCells + to_x) * kDescriptorBins;
    histogram[cell + b % kDescriptorBins][lane] += share - share * next;
    histogram[cell + (b + 1) % kDescriptorBins][lane] += share * next;
  }
}

// Adds the pixels of the window to the lane's histogram.
__device__ void AddWindow(const SiftOctave& octave, const SiftPoint& point, float angle, int lane,
                          float (*histogram)[kLanes]) {
  const int radius = DescriptorRadius(point.sigma);
  const int xi = static_cast<int>(point.x + 0.5f), yi = static_cast<int>(point.y + 0.5f);
  const float* level = octave.Row(point.level, 0);
  const float cosine = cosf(angle), sine = sinf(angle);
  const float side = kDescriptorCell * point.sigma, to_cell = 1 / side;
  for (int y = max(1, yi - radius); y < min(octave.height - 1, yi + radius + 1); ++y) {
    const float dy = static_cast<float>(y) - point.y;
    RowPart part = {static_cast<float>(max(1, xi - radius)) - point.x,
                    static_cast<float>(min(octave.width - 2, xi + radius)) - point.x};
    part.Narrow(cosine, sine * dy, kDescriptorReach * side);
    part.Narrow(-sine, cosine * dy, kDescriptorReach * side);
    const int end = static_cast<int>(floorf(part.to + point.x)) + 1;
    for (int x = static_cast<int>(ceilf(part.from + point.x)) + lane; x < end; x += kLanes) {
      const float dx = static_cast<float>(x) - point.x;
      const float nx = (cosine * dx + sine * dy) * to_cell;
      const float ny = (cosine * dy - sine * dx) * to_cell;
      if (fabsf(nx) >= kDescriptorReach || fabsf(ny) >= kDescriptorReach) continue;
      const Gradient gradient = GradientAt(octave, level, x, y);
      const float value = Exp(-0.125f * (nx * nx + ny * ny)) * gradient.magnitude;
      // Two turns are added to keep the direction positive.
      const float bin =
          (gradient.angle - angle) * (kDescriptorBins / (2 * kPi)) + 2 * kDescriptorBins;
      AddToCells(value, nx + kDescriptorReach, ny + kDescriptorReach, bin, lane, histogram);
    }
  }
}

// Sum over the lanes, in all lanes; always the same tree.
__device__ float WarpSum(float value) {
  for (int offset = kLanes / 2; offset > 0; offset /= 2) {
    value += __shfl_xor_sync(kAllLanes, value, offset);
  }
  return value;
}

// Normalises the histogram and writes its bytes.
__device__ void WriteDescriptor(const float (*histogram)[kLanes], int lane, uint8_t* descriptor) {
  constexpr int kOwn = kSiftDescriptorSize / kLanes;
  float value[kOwn], squares = 0, sum = 0;
  for (int k = 0; k < kOwn; ++k) {
    value[k] = SumOfLanes(histogram, lane + k * kLanes, lane);
    squares += value[k] * value[k];
  }
  const float limit = kDescriptorClamp * Sqrt(WarpSum(squares));
  for (int k = 0; k < kOwn; ++k) sum += value[k] = fminf(value[k], limit);
  sum = WarpSum(sum);
  for (int k = 0; k < kOwn; ++k) {
    const int bin = lane + k * kLanes, cell = bin / kDescriptorBins;
    const int index =
        DescriptorIndex(cell / kDescriptorCells, cell % kDescriptorCells, bin % kDescriptorBins);
    descriptor[index] = RootSiftByte(value[k], sum);
  }
}

__global__ void __launch_bounds__(kDescriptorWarps* kLanes) DescriptorKernel(SiftDescribe p) {
  __shared__ float histograms[kDescriptorWarps][kSiftDescriptorSize][kLanes];
  const int warp = static_cast<int>(threadIdx.x) / kLanes;
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const int task = static_cast<int>(blockIdx.x) * kDescriptorWarps + warp;
  const int i = task / kMaxOrientations, k = task % kMaxOrientations;
  if (i >= p.num_points || k >= p.first[i + 1] - p.first[i]) return;
  float(*histogram)[kLanes] = histograms[warp];
  for (int bin = 0; bin < kSiftDescriptorSize; ++bin) histogram[bin][lane] = 0;
  const SiftFound point = p.points[i];
  const float angle = p.angles[i].angle[k];
  AddWindow(p.pyramid.octaves[point.octave], point.in_octave, angle, lane, histogram);
  __syncwarp();
  const int64_t feature = p.first[i] + k;
  WriteDescriptor(histogram, lane, p.descriptors + feature * kSiftDescriptorSize);
  if (lane != 0) return;
  p.keypoints[feature] = point.keypoint;
  p.keypoints[feature].angle = angle;
}

}  // namespace

void LaunchSiftDirections(const SiftPyramid& pyramid, const SiftFound* points, int count,
                          SiftAngles* angles, int32_t* num_angles, cudaStream_t stream) {
  DirectionKernel<<<NumBlocks(count, kDirectionWarps), kDirectionWarps * kLanes, 0, stream>>>(
      pyramid, points, count, angles, num_angles);
}

void LaunchSiftDescriptors(const SiftDescribe& describe, cudaStream_t stream) {
  const int64_t num_tasks = int64_t{describe.num_points} * kMaxOrientations;
  DescriptorKernel<<<NumBlocks(num_tasks, kDescriptorWarps), kDescriptorWarps * kLanes, 0,
                     stream>>>(describe);
}

}  // namespace pepeseg
