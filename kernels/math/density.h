#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "kernels/math/blend.h"
#include "kernels/math/projection.h"
#include "kernels/math/vec.h"

// Density control (Kerbl et al. 2023, section 5; METHOD.md section 1, "Density"), one Gaussian at a
// time: whether it is pruned, kept, cloned or split, where children are drawn, and the order of
// Gaussians in memory. The argument structs are in kernels/ops/density.h.

namespace pepeseg {

// log(1.6): a child's standard deviations are 1 / (0.8 * number of children) of its parent's, and
// there are two children.
inline constexpr float kLogSplitShrink = 0.47000363f;

// Fate of a Gaussian.
enum DensityFate : uint8_t { kFatePruned = 0, kFateKept = 1, kFateCloned = 2, kFateSplit = 3 };
// Number of Gaussians that one of this fate leaves: 0, 1, 2 or 2.
PEPESEG_HD int NumRowsOf(DensityFate fate) {
  return fate == kFateSplit ? 2 : static_cast<int>(fate);
}

// Bounds that decide a fate, in the units in which parameters are stored.
struct DensityBounds {
  float min_gradient;     // mean gradient of the position on screen from which on it is densified
  float clone_log_scale;  // largest log scale of a Gaussian that is cloned and not split
  float min_logit;        // of the opacity; fainter Gaussians, and NaN, are pruned
  float max_log_scale;    // largest log scale of a Gaussian, or of its children; infinity: no limit
};
// Returns the fate before the limit on the number of Gaussians is applied.
PEPESEG_HD DensityFate FateOf(const DensityBounds& bounds, float logit, float largest_log_scale,
                              float mean_gradient) {
  if (!(logit >= bounds.min_logit)) return kFatePruned;
  const bool densified = mean_gradient >= bounds.min_gradient;
  const bool split = densified && !(largest_log_scale <= bounds.clone_log_scale);
  // 3DGS prunes after it has split: the children's size counts.
  if (largest_log_scale - (split ? kLogSplitShrink : 0) > bounds.max_log_scale) return kFatePruned;
  if (split) return kFateSplit;
  return densified ? kFateCloned : kFateKept;
}
// Bounds from the arguments of PlanDensity: sizes in scene units, an opacity in [0, 1). The bound
// for a min_opacity of 0 is -infinity, for a max_size of 0 infinity.
inline DensityBounds MakeDensityBounds(float min_gradient, float clone_size, float min_opacity,
                                       float max_size) {
  return {min_gradient, std::log(clone_size), std::log(min_opacity / (1 - min_opacity)),
          max_size > 0 ? std::log(max_size) : std::numeric_limits<float>::infinity()};
}

// Hash of 32 bits (lowbias32 of Wellons' hash-prospector): every bit depends on all bits of x.
PEPESEG_HD uint32_t MixBits(uint32_t x) {
  x = (x ^ x >> 16) * 0x7feb352du;
  x = (x ^ x >> 15) * 0x846ca68bu;
  return x ^ x >> 16;
}

// Element `number` of the random stream that `seed` and `row` name. Uniform in (0, 1]; 1 occurs
// only where float rounds the largest value up.
template <class T>
PEPESEG_HD T UniformNumber(uint32_t seed, uint32_t row, uint32_t number) {
  const uint32_t bits = MixBits(MixBits(MixBits(seed) ^ row) ^ number);
  return (static_cast<T>(bits >> 8) + T(0.5)) * T(1.0 / (1 << 24));
}

// Key of a draw without replacement: the Gaussians with the n largest keys are a sample of n by
// these odds (Efraimidis & Spirakis 2006). Positive for positive odds.
PEPESEG_HD float DrawKey(float odds, uint32_t seed, uint32_t row) {
  constexpr uint32_t kNumber = 8;  // the children of the row have the numbers before it
  const float exponential = -Log(UniformNumber<float>(seed, row, kNumber));
  return odds / (exponential > 1e-12f ? exponential : 1e-12f);
}

// Three independent standard normal numbers (Box & Muller 1958) for child 0 or 1 of Gaussian `row`.
template <class T>
PEPESEG_HD Vec3<T> NormalNumbers(uint32_t seed, uint32_t row, uint32_t child) {
  constexpr T kTwoPi = T(6.283185307179586);
  T u[4];
  for (uint32_t k = 0; k < 4; ++k) u[k] = UniformNumber<T>(seed, row, 4 * child + k);
  const T r0 = Sqrt(T(-2) * Log(u[0])), r1 = Sqrt(T(-2) * Log(u[1]));
  return {r0 * Cos(kTwoPi * u[2]), r0 * Cos(kTwoPi * (u[2] - T(0.25))), r1 * Cos(kTwoPi * u[3])};
}

// Position of a child, drawn from the Gaussian by a standard normal vector.
template <class T>
PEPESEG_HD Vec3<T> ChildMean(const GaussianShape<T>& shape, Vec3<T> normal) {
  const Vec3<T> deviation = {Exp(shape.log_scale.x), Exp(shape.log_scale.y),
                             Exp(shape.log_scale.z)};
  return shape.mean + RotationFromQuaternion(shape.rotation) * Scale(deviation, normal);
}

// Cells of a box, 2^21 per axis, which a Morton code numbers so that neighbours in space are mostly
// neighbours in memory.
struct MortonGrid {
  double min[3];             // corner of the box, scene units
  double cells_per_unit[3];  // 0 along an axis on which the box has no extent
};
inline constexpr int kMortonBits = 21;
// `min` and `max` are the corners of the box, x, y, z.
PEPESEG_HD MortonGrid MakeMortonGrid(const float* min, const float* max) {
  MortonGrid grid;
  for (int axis = 0; axis < 3; ++axis) {
    const double extent = static_cast<double>(max[axis]) - min[axis];
    grid.min[axis] = min[axis];
    grid.cells_per_unit[axis] = extent > 0 ? ((1 << kMortonBits) - 1) / extent : 0;
  }
  return grid;
}
// Spreads the low 21 bits of x, with two zero bits between neighbours.
PEPESEG_HD uint64_t SpreadBits(uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x001f00000000ffff;
  x = (x | x << 16) & 0x001f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  return (x | x << 2) & 0x1249249249249249;
}
// Morton code of a position x, y, z: 21 bits per axis, interleaved, x lowest. A coordinate that is
// not finite, or outside the box, counts as cell 0.
PEPESEG_HD uint64_t MortonCode(const MortonGrid& grid, const float* place) {
  constexpr double kLast = (1 << kMortonBits) - 1;
  uint64_t code = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double cell =
        (static_cast<double>(place[axis]) - grid.min[axis]) * grid.cells_per_unit[axis];
    const uint64_t bits = cell >= 0 && cell <= kLast ? static_cast<uint64_t>(cell) : 0;
    code |= SpreadBits(bits) << axis;
  }
  return code;
}

}  // namespace pepeseg
