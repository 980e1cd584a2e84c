#include "kernels/cpu/feature_jobs.h"
#include "kernels/cpu/simd/feature_lanes.h"
#include "kernels/cpu/simd/kernels.h"

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

constexpr int kTileRows = 8;  // correlations of 8 pixels p are held in registers
constexpr int kColumnVectors = kPairColumns / kLanes;

// cosine[row][scale][column] of a tile: correlations live no longer than this.
struct Cosines {
  alignas(64) float at[kTileRows][kMaxScales][kPairColumns];
};

PEPESEG_HD const float* UnitOf(const PairJob& job, int scale, int pixel) {
  return job.unit + (int64_t{scale} * job.padded + pixel) * kFeatureSize;
}

PEPESEG_HD void Correlate(const PairJob& job, int p, int q, Cosines& cosines) {
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const float* rows = UnitOf(job, scale, p);
    const float* columns = job.unit_by_channel + int64_t{scale} * kFeatureSize * job.padded + q;
    for (int v = 0; v < kColumnVectors; ++v) {
      Lanes sum[kTileRows];
      for (Lanes& s : sum) s = Lanes(0.0f);
      for (int channel = 0; channel < kFeatureSize; ++channel) {
        const Lanes column = Lanes::Load(columns + int64_t{channel} * job.padded + v * kLanes);
        for (int i = 0; i < kTileRows; ++i) {
          sum[i] = MulAdd(Lanes(rows[i * kFeatureSize + channel]), column, sum[i]);
        }
      }
      for (int i = 0; i < kTileRows; ++i) sum[i].Store(cosines.at[i][scale] + v * kLanes);
    }
  }
}

// The same for (p, q) and (q, p).
PEPESEG_HD uint32_t PairHash(uint32_t p, uint32_t q, uint32_t seed) {
  const uint32_t low = p < q ? p : q, high = p < q ? q : p;
  uint32_t h = (high << 16 | low) ^ seed;
  h = (h ^ h >> 16) * 0x7feb352du;
  h = (h ^ h >> 15) * 0x846ca68bu;
  return h ^ h >> 16;
}

// Which of the pixels q a pixel p is paired with, and their labels.
struct Choice {
  uint32_t chosen;              // a bit for each q
  uint32_t agrees[kMaxScales];  // likewise: G = 1
  alignas(64) float weight[kPairColumns];
};

PEPESEG_HD uint32_t BitsBelow(const float* values, float limit) {
  uint32_t bits = 0;
  for (int v = 0; v < kColumnVectors; ++v) {
    bits |= BitsOf(Lanes::Load(values + v * kLanes) < Lanes(limit)) << (v * kLanes);
  }
  return bits;
}

PEPESEG_HD Choice Choose(const PairJob& job, int p, int q, const float (*cosine)[kPairColumns]) {
  Choice choice = {};
  const uint32_t all = (1u << job.num_scales) - 1u;
  const uint32_t* row = job.agrees + int64_t{job.patch[p]} * job.args->num_patches;
  uint32_t by_pair[kPairColumns];
  uint32_t constant_positive = 0, constant_negative = 0, drawn = 0;
  for (int j = 0; j < kPairColumns; ++j) by_pair[j] = row[job.patch[q + j]];
  for (int j = 0; j < kPairColumns; ++j) {
    constant_positive |= static_cast<uint32_t>(by_pair[j] == all) << j;
    constant_negative |= static_cast<uint32_t>(by_pair[j] == 0) << j;
    const uint32_t limit = by_pair[j] == 0 ? job.negative_limit : job.positive_limit;
    const auto column = static_cast<uint32_t>(q + j);
    const uint32_t hash = PairHash(static_cast<uint32_t>(p), column, job.args->pair_seed);
    drawn |= static_cast<uint32_t>(hash < limit) << j;
  }
  choice.chosen = ~(constant_positive | constant_negative) | drawn;
  for (int scale = 0; scale < job.num_scales; ++scale) {
    uint32_t agrees = 0;
    for (int j = 0; j < kPairColumns; ++j) agrees |= (by_pair[j] >> scale & 1u) << j;
    choice.agrees[scale] = agrees;
    const uint32_t low = BitsBelow(cosine[scale], job.args->min_positive);
    const uint32_t not_high = BitsBelow(cosine[scale], job.args->max_negative);
    choice.chosen |= (agrees & low) | (~agrees & ~not_high);
  }
  // Neither with itself nor with the padding.
  const int num_columns = job.num_pixels - q < kPairColumns ? job.num_pixels - q : kPairColumns;
  choice.chosen &= (1u << num_columns) - 1u;
  if (p >= q && p < q + kPairColumns) choice.chosen &= ~(1u << (p - q));
  for (int j = 0; j < kPairColumns; ++j) {
    const float product = job.pixel_weight[p] * job.pixel_weight[q + j];
    choice.weight[j] = MulAdd(job.weight_slope, product, job.weight_base);
  }
  return choice;
}

// grad += sum over the set bits j of weight[j] * unit[j].
PEPESEG_HD void AddUnits(uint32_t bits, const float* weight, const float* units, float* grad) {
  if (bits == 0) return;
  FeatureLanes sum = LoadFeature(grad);
  for (; bits != 0; bits &= bits - 1) {
    const int j = __builtin_ctz(bits);
    AddScaled(weight[j], units + j * kFeatureSize, sum);
  }
  StoreFeature(sum, grad);
}

PEPESEG_HD void AddTerms(const PairJob& job, int p, int q, const float (*cosine)[kPairColumns],
                         const Choice& choice, PairBlock& block) {
  const int64_t half = int64_t{job.num_scales} * job.padded * kFeatureSize;
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const uint32_t positive = choice.chosen & choice.agrees[scale];
    const uint32_t negative = choice.chosen & ~choice.agrees[scale];
    float positive_sum = 0, negative_sum = 0;
    alignas(64) float positive_grad[kPairColumns], negative_grad[kPairColumns];
    uint32_t pushes = 0;
    for (int j = 0; j < kPairColumns; ++j) {
      const float w = choice.weight[j], c = cosine[scale][j];
      positive_sum += (positive >> j & 1u) != 0 ? PositiveTerm(w, c) : 0.0f;
      negative_sum += (negative >> j & 1u) != 0 ? NegativeTerm(w, c) : 0.0f;
      positive_grad[j] = PositiveTermVjp(w);
      negative_grad[j] = NegativeTermVjp(w, c);
      pushes |= static_cast<uint32_t>(c > 0) << j;
    }
    block.sums[kPositiveLoss] += static_cast<double>(positive_sum);
    block.sums[kNegativeLoss] += static_cast<double>(negative_sum);
    block.sums[kNumPositives] += __builtin_popcount(positive);
    block.sums[kNumNegatives] += __builtin_popcount(negative);
    float* grad = job.unit_grad + (int64_t{scale} * job.padded + p) * kFeatureSize;
    AddUnits(positive, positive_grad, UnitOf(job, scale, q), grad);
    AddUnits(negative & pushes, negative_grad, UnitOf(job, scale, q), grad + half);
  }
}

PEPESEG_HD FeatureLanes PsiOf(const PairJob& job, int scale) {
  return LoadFeature(job.psi + scale * kFeatureSize);
}

PEPESEG_HD void AddNormTerm(const PairJob& job, const FeatureLanes& feature, PairBlock& block,
                            FeatureLanes& grad) {
  block.sums[kNormLoss] += static_cast<double>(First(NormTerm(feature.v, kVectors)));
  const Lanes pull = NormTermVjp(feature.v, kVectors, Lanes(job.norm_scale));
  for (int k = 0; k < kVectors; ++k) grad.v[k] = MulAdd(pull, feature.v[k], grad.v[k]);
}

}  // namespace

void GatePixels(const PairJob& job, int first, int end) {
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const FeatureLanes psi = PsiOf(job, scale);
    float* by_channel = job.unit_by_channel + int64_t{scale} * kFeatureSize * job.padded;
    for (int p = first; p < end; ++p) {
      float* unit = job.unit + (int64_t{scale} * job.padded + p) * kFeatureSize;
      const FeatureLanes feature =
          LoadFeature(job.args->pixel_features.data + int64_t{p} * kFeatureSize);
      FeatureLanes out;
      GatedUnit(psi.v, feature.v, kVectors, out.v);
      StoreFeature(out, unit);
      for (int k = 0; k < kFeatureSize; ++k) by_channel[int64_t{k} * job.padded + p] = unit[k];
    }
  }
}

void PairRows(const PairJob& job, PairBlock& block) {
  Cosines cosines;
  for (int q = 0; q < job.num_pixels; q += kPairColumns) {
    for (int p = block.first; p < block.end; p += kTileRows) {
      Correlate(job, p, q, cosines);
      for (int i = 0; i < kTileRows && p + i < block.end; ++i) {
        const Choice choice = Choose(job, p + i, q, cosines.at[i]);
        if (choice.chosen != 0) AddTerms(job, p + i, q, cosines.at[i], choice, block);
      }
    }
  }
}

// From the gradients of the units to those of the features and of the gate.
void PairRowsVjp(const PairJob& job, PairBlock& block) {
  const int64_t half = int64_t{job.num_scales} * job.padded * kFeatureSize;
  FeatureLanes psi_grad[kMaxScales];
  for (FeatureLanes& grad : psi_grad) grad = ZeroFeature();
  for (int p = block.first; p < block.end; ++p) {
    const FeatureLanes feature =
        LoadFeature(job.args->pixel_features.data + int64_t{p} * kFeatureSize);
    FeatureLanes grad = ZeroFeature();
    for (int scale = 0; scale < job.num_scales; ++scale) {
      const float* sums = job.unit_grad + (int64_t{scale} * job.padded + p) * kFeatureSize;
      FeatureLanes unit_grad = ZeroFeature();
      AddScaled(job.positive_scale, sums, unit_grad);
      AddScaled(job.negative_scale, sums + half, unit_grad);
      GatedUnitVjp(PsiOf(job, scale).v, feature.v, kVectors, unit_grad.v, grad.v,
                   psi_grad[scale].v);
    }
    if (job.args->pixel_alpha.data[p] > job.args->min_norm_alpha) {
      AddNormTerm(job, feature, block, grad);
    }
    StoreFeature(grad, job.args->pixel_grad.data + int64_t{p} * kFeatureSize);
  }
  for (int scale = 0; scale < job.num_scales; ++scale) {
    StoreFeature(psi_grad[scale], block.psi_grad + scale * kFeatureSize);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
