#pragma once

#include "kernels/gaussian_planes.h"
#include "kernels/math/projection.h"
#include "kernels/math/sh.h"
#include "kernels/render_scratch.h"

namespace pepeseg {

// GaussianPlanes as kernels read them: parameter `plane` of Gaussian i. Lanes of a warp that have
// neighbouring Gaussians read neighbouring floats.
template <class T>
struct DevicePlanes {
  T* data;
  int64_t stride;
  // `plane` is the same for a whole warp, so that the address of the plane stays in uniform
  // registers; i must be below 2^32.
  __device__ T& At(int plane, int64_t i) const {
    return (data + plane * stride)[static_cast<uint32_t>(i)];
  }
};
inline DevicePlanes<const float> ToDevice(const ConstGaussianPlanes& planes) {
  return {planes.data, planes.stride};
}
inline DevicePlanes<float> ToDevice(const GaussianPlanes& planes) {
  return {planes.data, planes.stride};
}

// Mean, log scales and quaternion of Gaussian i.
__device__ inline GaussianShape<float> LoadShape(const DevicePlanes<const float>& planes,
                                                 int64_t i) {
  return {{planes.At(kMeanPlane, i), planes.At(kMeanPlane + 1, i), planes.At(kMeanPlane + 2, i)},
          {planes.At(kLogScalePlane, i), planes.At(kLogScalePlane + 1, i),
           planes.At(kLogScalePlane + 2, i)},
          {planes.At(kRotationPlane, i), planes.At(kRotationPlane + 1, i),
           planes.At(kRotationPlane + 2, i), planes.At(kRotationPlane + 3, i)}};
}

// A splat as three 16-byte words, the widest load and store of a thread:
// (x, y, root_xx, root_xy), (root_yy, opacity, r, g), (b, depth, min_power, half_height).
static_assert(sizeof(Splat) == 48);
struct SplatWords {
  float4 a, b, c;
};
__device__ inline SplatWords LoadSplat(const Splat* splats, int32_t visible) {
  const float4* words = reinterpret_cast<const float4*>(splats + visible);
  return {words[0], words[1], words[2]};
}
__device__ inline Splat ToSplat(const SplatWords& w) {
  return {w.a.x, w.a.y, w.a.z, w.a.w, w.b.x, w.b.y, w.b.z, w.b.w, w.c.x, w.c.y, w.c.z, w.c.w};
}

// Tile-entry capacity of a render, and the counters from which each kernel reads on the device
// whether the render overflowed (see RenderArgs::tile_entry_capacity). The host does not know it
// when it launches.
struct Room {
  const int64_t* counters;
  int64_t entries;
  __device__ bool IsVoid() const { return counters[kNumTileEntries] > entries; }
};
inline Room RoomOf(const RenderScratch& scratch) {
  return {scratch.counters.span().data, scratch.entry_visible.size()};
}

}  // namespace pepeseg
