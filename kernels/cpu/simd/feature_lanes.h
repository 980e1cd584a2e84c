#pragma once

#include "kernels/cpu/simd/lanes.h"
#include "kernels/feature_ops.h"
#include "kernels/math/pair.h"

namespace pepeseg {
namespace HWY_NAMESPACE {

// A feature vector is kVectors vectors of lanes.
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
PEPESEG_HD void AddScaled(float scale, const float* from, FeatureLanes& to) {
  HWY_UNROLL(kVectors)
  for (int k = 0; k < kVectors; ++k) {
    to.v[k] = MulAdd(Lanes(scale), Lanes::Load(from + k * kLanes), to.v[k]);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
