#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/lanes.h"
#include "kernels/cpu/simd_kernels.h"

// The passes of PerceptionLoss. Pairs are sparse, so each is evaluated by itself, a feature across
// the lanes.

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

PEPESEG_HD FeatureLanes PsiOf(const PerceptionJob& job, int scale) {
  return LoadFeature(job.psi + scale * kFeatureSize);
}
PEPESEG_HD float* UnitOf(const PerceptionJob& job, int64_t pixel, int scale) {
  return job.unit + (pixel * job.num_scales + scale) * kFeatureSize;
}
PEPESEG_HD FeatureLanes FeatureOf(const PerceptionJob& job, int64_t pixel) {
  return LoadFeature(job.args->pixel_features.data + pixel * kFeatureSize);
}
PEPESEG_HD bool HasPair(const PerceptionJob& job, int64_t pixel) {
  return job.args->first.data[pixel] < job.args->first.data[pixel + 1];
}

// For unit vectors.
PEPESEG_HD float Cosine(const FeatureLanes& a, const FeatureLanes& b) {
  Lanes sum(0.0f);
  for (int k = 0; k < kVectors; ++k) sum = MulAdd(a.v[k], b.v[k], sum);
  return First(Total(sum));
}

// Returns the sum of the terms of one entry at all scales, and adds their gradients with respect to
// the unit vectors of pixel p. The other pixel gets its gradient from the entry of its own.
PEPESEG_HD float AddPair(const PerceptionJob& job, int64_t p, int32_t entry,
                         FeatureLanes* unit_grads) {
  const PerceptionLossArgs& args = *job.args;
  const PairCues cues = args.cues.data[entry];
  float loss = 0;
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const bool similar = (cues >> scale & 1u) != 0;
    if (!similar && (cues >> (kDissimilarShift + scale) & 1u) == 0) continue;
    const float* other = UnitOf(job, args.other.data[entry], scale);
    const float cosine = Cosine(LoadFeature(UnitOf(job, p, scale)), LoadFeature(other));
    const float share = args.share.data[similar ? scale : job.num_scales + scale];
    loss += similar ? share + PositiveTerm(share, cosine) : NegativeTerm(share, cosine, 0.0f);
    const float pull = similar ? PositiveTermVjp(share) : NegativeTermVjp(share, cosine, 0.0f);
    AddScaled(args.weight * pull, other, unit_grads[scale]);
  }
  return loss;
}

}  // namespace

// Fills the unit vectors of pixels that have a pair.
void PerceptionUnits(const PerceptionJob& job, FeatureRange range) {
  for (int64_t p = range.first; p < range.end; ++p) {
    if (!HasPair(job, p)) continue;
    const FeatureLanes feature = FeatureOf(job, p);
    for (int scale = 0; scale < job.num_scales; ++scale) {
      FeatureLanes unit;
      GatedUnit(PsiOf(job, scale).v, feature.v, kVectors, unit.v);
      StoreFeature(unit, UnitOf(job, p, scale));
    }
  }
}

// Adds the entries of each pixel in their order, then passes the gradients of its unit vectors on
// to its feature and to psi.
void PerceptionRows(const PerceptionJob& job, PerceptionBlock& block) {
  FeatureLanes psi_grad[kMaxScales];
  for (FeatureLanes& grad : psi_grad) grad = ZeroFeature();
  for (int64_t p = block.first; p < block.end; ++p) {
    if (!HasPair(job, p)) continue;
    FeatureLanes unit_grads[kMaxScales];
    for (FeatureLanes& grad : unit_grads) grad = ZeroFeature();
    for (int32_t e = job.args->first.data[p]; e < job.args->first.data[p + 1]; ++e) {
      block.loss += static_cast<double>(AddPair(job, p, e, unit_grads));
    }
    float* pixel_grad = job.args->pixel_grad.data + p * kFeatureSize;
    const FeatureLanes feature = FeatureOf(job, p);
    FeatureLanes grad = LoadFeature(pixel_grad);
    for (int scale = 0; scale < job.num_scales; ++scale) {
      GatedUnitVjp(PsiOf(job, scale).v, feature.v, kVectors, unit_grads[scale].v, grad.v,
                   psi_grad[scale].v);
    }
    StoreFeature(grad, pixel_grad);
  }
  for (int scale = 0; scale < job.num_scales; ++scale) {
    StoreFeature(psi_grad[scale], block.psi_grad + scale * kFeatureSize);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
