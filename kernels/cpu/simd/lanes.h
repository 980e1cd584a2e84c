#pragma once

#include <hwy/highway.h>

#include <cstdint>

#include "kernels/gaussian_planes.h"
#include "kernels/math/feature.h"
#include "kernels/math/hd.h"
#include "kernels/math/projection.h"
#include "kernels/math/sh.h"
#include "kernels/ops/feature.h"

// A vector of floats that the templates of kernels/math take as a scalar, and how Gaussians and
// features are loaded into such vectors.
//
// Dispatch: the files of this folder are compiled once for each instruction set, each time in a
// namespace of its own (HWY_NAMESPACE). Vectors have 4 lanes with SSE4, 8 with AVX2 and 16 with
// AVX-512. BestSimdKernels (kernels/cpu/simd_kernels.h) chooses a set at run time.
//
// Files of this folder must not call inline functions of the standard library, nor of ours outside
// kernels/math, which is always inlined: the linker keeps one copy of such a function, and one that
// was compiled for a newer CPU could replace the copy that older CPUs need.
namespace pepeseg {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using FloatTag = hn::CappedTag<float, 16>;
using IntTag = hn::RebindToSigned<FloatTag>;
inline constexpr int kLanes = HWY_MIN(HWY_LANES(float), 16);

// Names the scalar overloads next to those for Lanes below.
using pepeseg::Exp;
using pepeseg::Exp2;
using pepeseg::Log2;
using pepeseg::Max;
using pepeseg::Min;
using pepeseg::MulAdd;
using pepeseg::NegMulAdd;
using pepeseg::Select;
using pepeseg::Sqrt;

// One bool for each lane.
struct LaneMask {
  hn::Mask<FloatTag> m;
};
// kLanes floats. Load and Store need no alignment.
struct Lanes {
  hn::Vec<FloatTag> v;

  Lanes() = default;
  PEPESEG_HD explicit Lanes(float x) : v(hn::Set(FloatTag(), x)) {}
  PEPESEG_HD explicit Lanes(hn::Vec<FloatTag> x) : v(x) {}
  static PEPESEG_HD Lanes Load(const float* p) { return Lanes(hn::LoadU(FloatTag(), p)); }
  PEPESEG_HD void Store(float* p) const { hn::StoreU(v, FloatTag(), p); }
};
// Returns first, first + 1, ... in the lanes.
PEPESEG_HD Lanes Ramp(float first) { return Lanes(hn::Iota(FloatTag(), first)); }

PEPESEG_HD Lanes operator+(Lanes a, Lanes b) { return Lanes(hn::Add(a.v, b.v)); }
PEPESEG_HD Lanes operator-(Lanes a, Lanes b) { return Lanes(hn::Sub(a.v, b.v)); }
PEPESEG_HD Lanes operator*(Lanes a, Lanes b) { return Lanes(hn::Mul(a.v, b.v)); }
PEPESEG_HD Lanes operator/(Lanes a, Lanes b) { return Lanes(hn::Div(a.v, b.v)); }
PEPESEG_HD LaneMask operator<(Lanes a, Lanes b) { return {hn::Lt(a.v, b.v)}; }
PEPESEG_HD LaneMask operator<=(Lanes a, Lanes b) { return {hn::Le(a.v, b.v)}; }
PEPESEG_HD LaneMask operator&(LaneMask a, LaneMask b) { return {hn::And(a.m, b.m)}; }
PEPESEG_HD LaneMask operator|(LaneMask a, LaneMask b) { return {hn::Or(a.m, b.m)}; }
// yes and not no.
PEPESEG_HD LaneMask AndNot(LaneMask no, LaneMask yes) { return {hn::AndNot(no.m, yes.m)}; }
PEPESEG_HD bool None(LaneMask a) { return hn::AllFalse(FloatTag(), a.m); }
PEPESEG_HD int Count(LaneMask a) { return static_cast<int>(hn::CountTrue(FloatTag(), a.m)); }
// Returns one bit for each lane, lane 0 the lowest.
PEPESEG_HD uint32_t BitsOf(LaneMask a) {
  uint64_t bits = 0;  // eight bytes may be written
  hn::StoreMaskBits(FloatTag(), a.m, reinterpret_cast<uint8_t*>(&bits));
  return static_cast<uint32_t>(bits);
}

PEPESEG_HD Lanes Select(LaneMask m, Lanes a, Lanes b) {
  return Lanes(hn::IfThenElse(m.m, a.v, b.v));
}
PEPESEG_HD Lanes Min(Lanes a, Lanes b) { return Lanes(hn::Min(a.v, b.v)); }
PEPESEG_HD Lanes Max(Lanes a, Lanes b) { return Lanes(hn::Max(a.v, b.v)); }
PEPESEG_HD Lanes Sqrt(Lanes a) { return Lanes(hn::Sqrt(a.v)); }
// Rounded once where the set has fused multiply-adds (not SSE4).
PEPESEG_HD Lanes MulAdd(Lanes a, Lanes b, Lanes c) { return Lanes(hn::MulAdd(a.v, b.v, c.v)); }
PEPESEG_HD Lanes NegMulAdd(Lanes a, Lanes b, Lanes c) {
  return Lanes(hn::NegMulAdd(a.v, b.v, c.v));
}

// Adds the blocks of four lanes of a vector, pairwise.
template <int kNumLanes, class V>
PEPESEG_HD auto SumOfBlocks(V v) {
  if constexpr (kNumLanes <= 4) {
    return v;
  } else {
    const hn::Half<hn::CappedTag<float, kNumLanes>> half;
    return SumOfBlocks<kNumLanes / 2>(hn::Add(hn::LowerHalf(half, v), hn::UpperHalf(half, v)));
  }
}
// Writes the sums of the lanes of four vectors to sums[4], with fewer shuffles than four single
// sums.
PEPESEG_HD void StoreSums(Lanes a, Lanes b, Lanes c, Lanes e, float* sums) {
  const FloatTag d;
  const hn::RepartitionToWide<IntTag> wide;
  // a0 + a2, b0 + b2, a1 + a3, b1 + b3 in each block of four.
  const auto ab = hn::Add(hn::InterleaveLower(d, a.v, b.v), hn::InterleaveUpper(d, a.v, b.v));
  const auto ce = hn::Add(hn::InterleaveLower(d, c.v, e.v), hn::InterleaveUpper(d, c.v, e.v));
  const auto ab2 = hn::BitCast(wide, ab), ce2 = hn::BitCast(wide, ce);
  const auto blocks = hn::Add(hn::BitCast(d, hn::InterleaveLower(wide, ab2, ce2)),
                              hn::BitCast(d, hn::InterleaveUpper(wide, ab2, ce2)));
  hn::StoreU(SumOfBlocks<kLanes>(blocks), hn::CappedTag<float, 4>(), sums);
}

// Returns 1 / a to about 2 ulp, for a in [1e-30, 1e30]: one step of Newton on the hardware's
// estimate.
PEPESEG_HD Lanes FastInverse(Lanes a) {
  const auto r = hn::ApproximateReciprocal(a.v);
  return Lanes(hn::Mul(r, hn::NegMulAdd(a.v, r, hn::Set(FloatTag(), 2.0f))));
}

// Returns 2^x with a relative error below 2e-7 for x in [-126, 127]; unspecified beyond. 2^round(x)
// goes into the exponent, the rest through a minimax polynomial on [-0.5, 0.5].
PEPESEG_HD Lanes Exp2(Lanes x) {
  const FloatTag d;
  const IntTag di;
  // Adding 1.5 * 2^23 rounds to an integer, which is then in the low bits.
  const auto magic = hn::Set(d, 12582912.0f);
  const auto shifted = hn::Add(x.v, magic);
  const auto whole = hn::BitCast(di, shifted);
  const auto f = hn::Sub(x.v, hn::Sub(shifted, magic));
  // Coefficients in pairs give a shorter chain of operations than Horner's scheme.
  const auto f2 = hn::Mul(f, f);
  const auto p01 = hn::MulAdd(hn::Set(d, 6.9314697e-1f), f, hn::Set(d, 1.0000001f));
  const auto p23 = hn::MulAdd(hn::Set(d, 5.5507133e-2f), f, hn::Set(d, 2.4022120e-1f));
  const auto p45 = hn::MulAdd(hn::Set(d, 1.3276472e-3f), f, hn::Set(d, 9.6755413e-3f));
  const auto p = hn::MulAdd(hn::MulAdd(p45, f2, p23), f2, p01);
  return Lanes(hn::BitCast(d, hn::Add(hn::BitCast(di, p), hn::ShiftLeft<23>(whole))));
}
// Returns e^x clamped to [2^-126, 2^127] for any x. NaN stays NaN, by the order of the operands of
// Max and Min.
PEPESEG_HD Lanes Exp(Lanes x) {
  return Exp2(Min(Lanes(127.0f), Max(Lanes(-126.0f), x * Lanes(1.44269504f))));
}
// Lane by lane, by the compiler's log2f.
PEPESEG_HD Lanes Log2(Lanes x) {
  float values[kLanes];
  x.Store(values);
  for (float& value : values) value = __builtin_log2f(value);
  return Lanes::Load(values);
}

// Loads and stores the first `count` of kLanes values. LoadSome sets the rest to 0, StoreSome
// leaves the rest of the memory alone.
PEPESEG_HD Lanes LoadSome(const float* p, int count) {
  if (count >= kLanes) return Lanes::Load(p);
  float values[kLanes] = {};
  for (int i = 0; i < count; ++i) values[i] = p[i];
  return Lanes::Load(values);
}
PEPESEG_HD void StoreSome(Lanes x, float* p, int count) {
  if (count >= kLanes) return x.Store(p);
  float values[kLanes];
  x.Store(values);
  for (int i = 0; i < count; ++i) p[i] = values[i];
}

// 1 to kLanes adjacent Gaussians of some planes, one for each lane. Lanes beyond `count` hold 0.
struct GaussianGroup {
  const float* data;  // plane 0 of the first of them
  int64_t stride;
  int count;

  PEPESEG_HD Lanes At(int plane) const { return LoadSome(data + plane * stride, count); }
};

PEPESEG_HD GaussianShape<Lanes> LoadShape(const GaussianGroup& g) {
  return {{g.At(kMeanPlane), g.At(kMeanPlane + 1), g.At(kMeanPlane + 2)},
          {g.At(kLogScalePlane), g.At(kLogScalePlane + 1), g.At(kLogScalePlane + 2)},
          {g.At(kRotationPlane), g.At(kRotationPlane + 1), g.At(kRotationPlane + 2),
           g.At(kRotationPlane + 3)}};
}

// Returns one colour channel before ShChannel: the sum of basis * coefficient.
PEPESEG_HD Lanes WeightedSum(const GaussianGroup& g, const Lanes* basis, int num_coefficients,
                             int channel) {
  Lanes sum(0.0f);
  for (int k = 0; k < num_coefficients; ++k) {
    sum = MulAdd(basis[k], g.At(kShPlane + 3 * k + channel), sum);
  }
  return sum;
}

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
