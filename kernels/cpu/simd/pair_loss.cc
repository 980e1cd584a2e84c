#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/lanes.h"
#include "kernels/cpu/simd_kernels.h"

// The passes of PairLoss over a block of pixels p against all pixels q. Tiles of 8 pixels p and 16
// pixels q are correlated at all scales, the pairs that count are chosen from the cosines, and
// their terms are added at once: cosines are never stored for more than one tile. A tile's pixels q
// are a word of bits, so that terms are added for the chosen pairs only. Each p gathers its own
// gradients in ascending order of q.

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

constexpr int kTileRows = 8;  // pixels p of a tile, whose correlations are held in registers
constexpr int kColumnVectors = kPairColumns / kLanes;

// Cosines of a tile by pixel p, scale and pixel q.
struct Cosines {
  alignas(64) float at[kTileRows][kMaxScales][kPairColumns];
};

// Unit vector of a pixel at a scale; those of the following pixels are behind it.
PEPESEG_HD const float* UnitOf(const PairJob& job, int scale, int pixel) {
  return job.unit + (int64_t{scale} * job.padded + pixel) * kFeatureSize;
}

// Fills the cosines of the pixels p from `p` on with the pixels q from `q` on.
PEPESEG_HD void Correlate(const PairJob& job, int p, int q, Cosines& cosines) {
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const float* rows = UnitOf(job, scale, p);
    const float* columns = job.unit_by_channel + (int64_t{scale} * job.padded + q) * kFeatureSize;
    for (int v = 0; v < kColumnVectors; ++v) {
      Lanes sum[kTileRows];
      HWY_UNROLL(kTileRows)
      for (int i = 0; i < kTileRows; ++i) sum[i] = Lanes(0.0f);
      for (int channel = 0; channel < kFeatureSize; ++channel) {
        const Lanes column = Lanes::Load(columns + channel * kPairColumns + v * kLanes);
        HWY_UNROLL(kTileRows)
        for (int i = 0; i < kTileRows; ++i) {
          sum[i] = MulAdd(Lanes(rows[i * kFeatureSize + channel]), column, sum[i]);
        }
      }
      HWY_UNROLL(kTileRows)
      for (int i = 0; i < kTileRows; ++i) sum[i].Store(cosines.at[i][scale] + v * kLanes);
    }
  }
}

using IntLanes = hn::Vec<IntTag>;
using UintTag = hn::RebindToUnsigned<FloatTag>;

PEPESEG_HD uint32_t BitsOf(hn::Mask<IntTag> mask) {
  return BitsOf(LaneMask{hn::RebindMask(FloatTag(), mask)});
}
// The inverse of BitsOf.
PEPESEG_HD LaneMask MaskOf(uint32_t bits) {
  const uint8_t bytes[8] = {static_cast<uint8_t>(bits), static_cast<uint8_t>(bits >> 8)};
  return {hn::LoadMaskBits(FloatTag(), bytes)};
}

// Returns 31 random bits for each pair of pixel p and the kLanes pixels from q on, as a hash of the
// pair and the seed: the same for (p, q) and (q, p). Pixels are below 2^16.
PEPESEG_HD IntLanes PairHash(uint32_t p, uint32_t q, uint32_t seed) {
  const UintTag d;
  const IntTag di;
  const auto row = hn::Set(di, static_cast<int32_t>(p));
  const auto column = hn::Iota(di, static_cast<int32_t>(q));
  const auto key = hn::Or(hn::ShiftLeft<16>(hn::Max(row, column)), hn::Min(row, column));
  auto h = hn::Xor(hn::BitCast(d, key), hn::Set(d, seed));
  h = hn::Mul(hn::Xor(h, hn::ShiftRight<16>(h)), hn::Set(d, 0x7feb352du));
  h = hn::Mul(hn::Xor(h, hn::ShiftRight<15>(h)), hn::Set(d, 0x846ca68bu));
  return hn::BitCast(di, hn::ShiftRight<1>(hn::Xor(h, hn::ShiftRight<16>(h))));
}

// The pixels q that a pixel p is paired with, and whether their labels agree.
struct Choice {
  uint32_t chosen;              // a bit for each q: the pair counts
  uint32_t agrees[kMaxScales];  // a bit for each q: G = 1 at that scale
};

// Chooses among kLanes pixels from q on, whose bits start at `offset`. The rules are those of
// PairLossArgs: hard, drawn or wrong.
PEPESEG_HD void ChooseLanes(const PairJob& job, int p, int q, const float (*cosine)[kPairColumns],
                            int offset, Choice& choice) {
  const IntTag d;
  const uint32_t* row = job.agrees + int64_t{job.cell[p]} * job.args->num_cells;
  const auto cell = hn::LoadU(d, job.cell + q);
  const auto agrees = hn::GatherIndex(d, reinterpret_cast<const int32_t*>(row), cell);
  const auto negative = hn::Eq(agrees, hn::Zero(d));
  const auto positive = hn::Eq(agrees, hn::Set(d, (1 << job.num_scales) - 1));
  const auto limit =
      hn::IfThenElse(negative, hn::Set(d, job.negative_limit), hn::Set(d, job.positive_limit));
  const auto hash =
      PairHash(static_cast<uint32_t>(p), static_cast<uint32_t>(q), job.args->pair_seed);
  const auto hard = hn::Not(hn::Or(negative, positive));
  auto chosen = hn::RebindMask(FloatTag(), hn::Or(hard, hn::Lt(hash, limit)));
  const Lanes min_positive(job.args->min_positive), max_negative(job.args->max_negative);
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const auto agree = hn::TestBit(agrees, hn::Set(d, 1 << scale));
    choice.agrees[scale] |= BitsOf(agree) << offset;
    const auto agree_float = hn::RebindMask(FloatTag(), agree);
    const Lanes c = Lanes::Load(cosine[scale] + offset);
    const auto low = hn::And(agree_float, (c < min_positive).m);
    const auto high = hn::AndNot(agree_float, (max_negative < c).m);
    chosen = hn::Or(chosen, hn::Or(low, high));
  }
  choice.chosen |= BitsOf(LaneMask{chosen}) << offset;
}

// Chooses among the kPairColumns pixels from q on.
PEPESEG_HD Choice Choose(const PairJob& job, int p, int q, const float (*cosine)[kPairColumns]) {
  Choice choice = {};
  for (int offset = 0; offset < kPairColumns; offset += kLanes) {
    ChooseLanes(job, p, q + offset, cosine, offset, choice);
  }
  // A pixel is paired neither with itself nor with padding.
  const int num_columns = job.num_pixels - q < kPairColumns ? job.num_pixels - q : kPairColumns;
  choice.chosen &= (1u << num_columns) - 1u;
  if (p >= q && p < q + kPairColumns) choice.chosen &= ~(1u << (p - q));
  return choice;
}

// Adds weight[j] * unit[j] to grad for each set bit j, in ascending order.
PEPESEG_HD void AddUnits(uint32_t bits, const float* weight, const float* units, float* grad) {
  if (bits == 0) return;
  FeatureLanes sum = LoadFeature(grad);
  for (; bits != 0; bits &= bits - 1) {
    const int j = __builtin_ctz(bits);
    AddScaled(weight[j], units + j * kFeatureSize, sum);
  }
  StoreFeature(sum, grad);
}

// The terms of the pairs (p, q) of a tile at one scale, and their weights for AddUnits.
struct Terms {
  alignas(64) float positive_grad[kPairColumns];
  alignas(64) float negative_grad[kPairColumns];
  uint32_t pushes;                   // a bit for each q: the negative term has a gradient
  Lanes positive_sum, negative_sum;  // of the terms, over all scales so far
};

// Evaluates the terms at one scale and adds them to the sums of `terms`.
PEPESEG_HD void EvaluateTerms(const float* weight, const float* cosine, float negative_margin,
                              uint32_t positive, uint32_t negative, Terms& terms) {
  const Lanes zero(0.0f), margin(negative_margin);
  terms.pushes = 0;
  for (int offset = 0; offset < kPairColumns; offset += kLanes) {
    const Lanes w = Lanes::Load(weight + offset), c = Lanes::Load(cosine + offset);
    const LaneMask pull = MaskOf(positive >> offset), push = MaskOf(negative >> offset);
    terms.positive_sum = terms.positive_sum + Select(pull, PositiveTerm(w, c), zero);
    terms.negative_sum = terms.negative_sum + Select(push, NegativeTerm(w, c, margin), zero);
    PositiveTermVjp(w).Store(terms.positive_grad + offset);
    NegativeTermVjp(w, c, margin).Store(terms.negative_grad + offset);
    terms.pushes |= BitsOf(margin < c) << offset;
  }
  terms.pushes &= negative;
}

// Adds the chosen pairs of pixel p at all scales to the gradients of p and the sums of the block.
PEPESEG_HD void AddTerms(const PairJob& job, int p, int q, const float (*cosine)[kPairColumns],
                         const Choice& choice, PairBlock& block) {
  const int64_t half = int64_t{job.num_scales} * job.padded * kFeatureSize;
  alignas(64) float weight[kPairColumns];
  const Lanes slope(job.weight_slope * job.pixel_weight[p]), base(job.weight_base);
  for (int offset = 0; offset < kPairColumns; offset += kLanes) {
    MulAdd(slope, Lanes::Load(job.pixel_weight + q + offset), base).Store(weight + offset);
  }
  Terms terms;
  terms.positive_sum = terms.negative_sum = Lanes(0.0f);
  int num_positives = 0, num_negatives = 0;
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const uint32_t positive = choice.chosen & choice.agrees[scale];
    const uint32_t negative = choice.chosen & ~choice.agrees[scale];
    num_positives += __builtin_popcount(positive);
    num_negatives += __builtin_popcount(negative);
    EvaluateTerms(weight, cosine[scale], job.args->negative_margin, positive, negative, terms);
    float* grad = job.unit_grad + (int64_t{scale} * job.padded + p) * kFeatureSize;
    AddUnits(positive, terms.positive_grad, UnitOf(job, scale, q), grad);
    AddUnits(terms.pushes, terms.negative_grad, UnitOf(job, scale, q), grad + half);
  }
  block.sums[kNumPositives] += num_positives;
  block.sums[kNumNegatives] += num_negatives;
  block.sums[kPositiveLoss] += static_cast<double>(First(Total(terms.positive_sum)));
  block.sums[kNegativeLoss] += static_cast<double>(First(Total(terms.negative_sum)));
}

PEPESEG_HD FeatureLanes PsiOf(const PairJob& job, int scale) {
  return LoadFeature(job.psi + scale * kFeatureSize);
}

// Adds the norm term of one pixel, (|F| - 1)^2, and its gradient.
PEPESEG_HD void AddNormTerm(const PairJob& job, const FeatureLanes& feature, PairBlock& block,
                            FeatureLanes& grad) {
  block.sums[kNormLoss] += static_cast<double>(First(NormTerm(feature.v, kVectors)));
  const Lanes pull = NormTermVjp(feature.v, kVectors, Lanes(job.norm_scale));
  for (int k = 0; k < kVectors; ++k) grad.v[k] = MulAdd(pull, feature.v[k], grad.v[k]);
}

}  // namespace

// Fills the unit vectors of pixels [first, end) in both layouts.
void GatePixels(const PairJob& job, int first, int end) {
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const FeatureLanes psi = PsiOf(job, scale);
    for (int p = first; p < end; ++p) {
      float* unit = job.unit + (int64_t{scale} * job.padded + p) * kFeatureSize;
      const FeatureLanes feature =
          LoadFeature(job.args->pixel_features.data + int64_t{p} * kFeatureSize);
      FeatureLanes out;
      GatedUnit(psi.v, feature.v, kVectors, out.v);
      StoreFeature(out, unit);
      const int column = p % kPairColumns;
      float* by_channel =
          job.unit_by_channel + (int64_t{scale} * job.padded + p - column) * kFeatureSize + column;
      for (int k = 0; k < kFeatureSize; ++k) by_channel[k * kPairColumns] = unit[k];
    }
  }
}

// Adds all pairs of the block's pixels. Columns are the outer loop, so that a group of pixels q
// stays in the cache for all p of the block.
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

// Turns the gradients of the unit vectors into those of the features and of psi, once the counts of
// positives and negatives are known, and adds the norm term.
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
