#pragma once

#include "kernels/cpu/simd/lanes.h"
#include "kernels/math/feature.h"
#include "kernels/ops/feature.h"

namespace pepeseg {
namespace HWY_NAMESPACE {

// A feature of 32 numbers is kVectors vectors of lanes. The templates of kernels/math/feature.h
// take it as an array of `count` = kVectors elements; Total sums the lanes of one, into all lanes.
inline constexpr int kVectors = kFeatureSize / kLanes;

using pepeseg::Total;
PEPESEG_HD Lanes Total(Lanes x) { return Lanes(hn::SumOfLanes(FloatTag(), x.v)); }
PEPESEG_HD float First(Lanes x) { return hn::GetLane(x.v); }

struct FeatureLanes {
  Lanes v[kVectors];
};
PEPESEG_HD FeatureLanes LoadFeature(const float* p) {
  FeatureLanes f;
  HWY_UNROLL(kVectors)
  for (int k = 0; k < kVectors; ++k) f.v[k] = Lanes::Load(p + k * kLanes);
  return f;
}
PEPESEG_HD void StoreFeature(const FeatureLanes& f, float* p) {
  HWY_UNROLL(kVectors)
  for (int k = 0; k < kVectors; ++k) f.v[k].Store(p + k * kLanes);
}
PEPESEG_HD FeatureLanes ZeroFeature() {
  FeatureLanes f;
  HWY_UNROLL(kVectors)
  for (int k = 0; k < kVectors; ++k) f.v[k] = Lanes(0.0f);
  return f;
}
// to += scale * from[0 .. 32).
PEPESEG_HD void AddScaled(float scale, const float* from, FeatureLanes& to) {
  HWY_UNROLL(kVectors)
  for (int k = 0; k < kVectors; ++k) {
    to.v[k] = MulAdd(Lanes(scale), Lanes::Load(from + k * kLanes), to.v[k]);
  }
}

// Returns the sum over the entries of column i of weight * rows[pixel], in their order.
PEPESEG_HD FeatureLanes GatherColumn(const ColumnSpan& columns, int64_t i, const float* rows) {
  FeatureLanes sum = ZeroFeature();
  const bool weighted = columns.weight.size != 0;
  for (int32_t e = columns.first.data[i]; e < columns.first.data[i + 1]; ++e) {
    AddScaled(weighted ? columns.weight.data[e] : 1.0f,
              rows + int64_t{columns.pixel.data[e]} * kFeatureSize, sum);
  }
  return sum;
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
