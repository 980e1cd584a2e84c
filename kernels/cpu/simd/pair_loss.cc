#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/lanes.h"
#include "kernels/cpu/simd_kernels.h"

// The passes of PairLoss. Tiles of 16 pixels p and 16 pixels q are correlated at all scales, the
// pairs that count are chosen from the cosines, and their terms are added at once: cosines are
// never stored for more than half a tile. Only tiles on and above the diagonal are, because a pair
// is the same in either order; what remains of a pair is a bit, for p and, transposed, for q. The
// gradients need no cosine, so a second pass gathers them by the bits, for each pixel in ascending
// order of the others.

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

constexpr int kTileRows = 8;  // pixels p whose correlations are held in registers
constexpr int kTileVectors = kPairTile / kLanes;

// Cosines of half a tile by pixel p, scale and pixel q.
struct Cosines {
  alignas(64) float at[kTileRows][kMaxScales][kPairTile];
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
    for (int v = 0; v < kTileVectors; ++v) {
      Lanes sum[kTileRows];
      HWY_UNROLL(kTileRows)
      for (int i = 0; i < kTileRows; ++i) sum[i] = Lanes(0.0f);
      for (int channel = 0; channel < kFeatureSize; ++channel) {
        const Lanes column = Lanes::Load(columns + channel * kPairTile + v * kLanes);
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
PEPESEG_HD void ChooseLanes(const PairJob& job, int p, int q, const float (*cosine)[kPairTile],
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

// Chooses among the kPairTile pixels from q on, those after p only.
PEPESEG_HD Choice Choose(const PairJob& job, int p, int q, const float (*cosine)[kPairTile]) {
  Choice choice = {};
  for (int offset = 0; offset < kPairTile; offset += kLanes) {
    ChooseLanes(job, p, q + offset, cosine, offset, choice);
  }
  // Padding has no pairs.
  const int num_columns = Max(0, Min(job.num_pixels - q, kPairTile));
  choice.chosen &= (1u << num_columns) - 1u;
  if (p >= q) choice.chosen &= ~((2u << (p - q)) - 1u);
  return choice;
}

// Writes the weights of the pairs of pixel p with the kPairTile pixels from q on.
PEPESEG_HD void PairWeights(const PairJob& job, int p, int q, float* weight) {
  const Lanes slope(job.weight_slope * job.pixel_weight[p]), base(job.weight_base);
  for (int offset = 0; offset < kPairTile; offset += kLanes) {
    MulAdd(slope, Lanes::Load(job.pixel_weight + q + offset), base).Store(weight + offset);
  }
}

// Adds the terms of the chosen pairs of pixel p at all scales to the sums of the block. Writes a
// word of bits for each scale to positives, and to negatives where the term has a gradient.
PEPESEG_HD void AddTerms(const PairJob& job, int p, int q, const float (*cosine)[kPairTile],
                         const Choice& choice, PairBlock& block, uint16_t* positives,
                         uint16_t* negatives) {
  alignas(64) float weight[kPairTile];
  PairWeights(job, p, q, weight);
  const Lanes zero(0.0f), margin(job.args->negative_margin);
  Lanes positive_sum = zero, negative_sum = zero;
  int num_positives = 0, num_negatives = 0;
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const uint32_t positive = choice.chosen & choice.agrees[scale];
    const uint32_t negative = choice.chosen & ~choice.agrees[scale];
    num_positives += __builtin_popcount(positive);
    num_negatives += __builtin_popcount(negative);
    uint32_t pushes = 0;
    for (int offset = 0; offset < kPairTile; offset += kLanes) {
      const Lanes w = Lanes::Load(weight + offset), c = Lanes::Load(cosine[scale] + offset);
      const LaneMask pull = MaskOf(positive >> offset), push = MaskOf(negative >> offset);
      positive_sum = positive_sum + Select(pull, PositiveTerm(w, c), zero);
      negative_sum = negative_sum + Select(push, NegativeTerm(w, c, margin), zero);
      pushes |= BitsOf(margin < c) << offset;
    }
    positives[scale] = static_cast<uint16_t>(positive);
    negatives[scale] = static_cast<uint16_t>(negative & pushes);
  }
  block.sums[kNumPositives] += num_positives;
  block.sums[kNumNegatives] += num_negatives;
  block.sums[kPositiveLoss] += static_cast<double>(First(Total(positive_sum)));
  block.sums[kNegativeLoss] += static_cast<double>(First(Total(negative_sum)));
}

// Bits of a tile: [pixel p, positives and negatives by scale], a bit for each q.
struct TileBits {
  uint16_t at[kPairTile][2 * kMaxScales];
};

// Turns words of bits by p into words by q, for `count` kinds of words.
PEPESEG_HD void Transpose(const TileBits& in, int count, TileBits& out) {
  const hn::CappedTag<uint16_t, kPairTile> d;
  constexpr int kStep = HWY_MIN(HWY_LANES(uint16_t), kPairTile);
  for (int kind = 0; kind < count; ++kind) {
    alignas(32) uint16_t words[kPairTile];
    for (int i = 0; i < kPairTile; ++i) words[i] = in.at[i][kind];
    for (int j = 0; j < kPairTile; ++j) {
      uint32_t bits = 0;
      for (int i = 0; i < kPairTile; i += kStep) {
        const auto bit = hn::Set(d, static_cast<uint16_t>(1u << j));
        uint8_t bytes[8] = {};
        hn::StoreMaskBits(d, hn::TestBit(hn::Load(d, words + i), bit), bytes);
        bits |= static_cast<uint32_t>(bytes[0] | (kStep > 8 ? bytes[1] << 8 : 0)) << i;
      }
      out.at[j][kind] = static_cast<uint16_t>(bits);
    }
  }
}

// Chooses the pairs of pixels p and q of a tile, adds their terms, and fills `bits` with those of
// which q comes after p.
PEPESEG_HD void ChooseTile(const PairJob& job, int p, int q, PairBlock& block, TileBits& bits) {
  Cosines cosines;
  for (int half = 0; half < kPairTile; half += kTileRows) {
    Correlate(job, p + half, q, cosines);
    for (int i = 0; i < kTileRows; ++i) {
      uint16_t* row = bits.at[half + i];
      const int pixel = p + half + i;
      Choice choice = {};
      if (pixel < block.end) choice = Choose(job, pixel, q, cosines.at[i]);
      if (choice.chosen == 0) {
        for (int kind = 0; kind < 2 * job.num_scales; ++kind) row[kind] = 0;
        continue;
      }
      AddTerms(job, pixel, q, cosines.at[i], choice, block, row, row + job.num_scales);
    }
  }
}

// Writes the bits of a tile to those of a panel, from pixel p on for tile number `column` of its q.
PEPESEG_HD void StoreBits(const PairJob& job, const TileBits& bits, uint16_t* panel, int row,
                          int column, int num_columns) {
  const int count = 2 * job.num_scales;
  for (int i = 0; i < kPairTile; ++i) {
    uint16_t* out = panel + (int64_t{row + i} * num_columns + column) * count;
    for (int kind = 0; kind < count; ++kind) out[kind] = bits.at[i][kind];
  }
}

// Adds weight[j] * unit[j] to sum for each set bit j, in ascending order.
PEPESEG_HD void AddUnits(uint32_t bits, const float* weight, const float* units,
                         FeatureLanes& sum) {
  for (; bits != 0; bits &= bits - 1) {
    const int j = __builtin_ctz(bits);
    AddScaled(weight[j], units + j * kFeatureSize, sum);
  }
}

// Adds the pairs of pixel p with the pixels from `first` to `end` to its gradients at one scale.
// `bits` are those of p at this scale.
PEPESEG_HD void GatherPixel(const PairJob& job, int scale, int p, int first, int end,
                            const uint16_t* bits) {
  const int64_t half = int64_t{job.num_scales} * job.padded * kFeatureSize;
  float* grad = job.unit_grad + (int64_t{scale} * job.padded + p) * kFeatureSize;
  FeatureLanes positive = LoadFeature(grad), negative = LoadFeature(grad + half);
  for (int q = first; q < end; q += kPairTile, bits += 2 * job.num_scales) {
    const uint32_t pulls = bits[0], pushes = bits[job.num_scales];
    if ((pulls | pushes) == 0) continue;
    alignas(64) float weight[kPairTile], pull_weight[kPairTile];
    PairWeights(job, p, q, weight);
    for (int i = 0; i < kPairTile; i += kLanes) {
      PositiveTermVjp(Lanes::Load(weight + i)).Store(pull_weight + i);
    }
    AddUnits(pulls, pull_weight, UnitOf(job, scale, q), positive);
    AddUnits(pushes, weight, UnitOf(job, scale, q), negative);
  }
  StoreFeature(positive, grad);
  StoreFeature(negative, grad + half);
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
      const int column = p % kPairTile;
      float* by_channel =
          job.unit_by_channel + (int64_t{scale} * job.padded + p - column) * kFeatureSize + column;
      for (int k = 0; k < kFeatureSize; ++k) by_channel[k * kPairTile] = unit[k];
    }
  }
}

// Columns are the outer loop, so that a group of pixels q stays in the cache for all p of the
// block.
void ChoosePairs(const PairJob& job, const PairPanel& panel, PairBlock& block) {
  const int num_row_tiles = (panel.end_row - panel.first_row) / kPairTile;
  const int num_column_tiles = (panel.end_column - panel.first_column) / kPairTile;
  const int first_column = panel.diagonal() ? block.first : panel.first_column;
  for (int q = first_column; q < panel.end_column; q += kPairTile) {
    const int column = (q - panel.first_column) / kPairTile;
    for (int p = block.first; p < block.first + kPairRows && p <= q; p += kPairTile) {
      TileBits bits, mirrored;
      ChooseTile(job, p, q, block, bits);
      Transpose(bits, 2 * job.num_scales, mirrored);
      if (p == q) {
        for (int i = 0; i < kPairTile; ++i) {
          for (int k = 0; k < 2 * job.num_scales; ++k) bits.at[i][k] |= mirrored.at[i][k];
        }
      } else {
        StoreBits(job, mirrored, panel.mirrored, q - panel.first_column,
                  (p - panel.first_row) / kPairTile, num_row_tiles);
      }
      StoreBits(job, bits, panel.bits, p - panel.first_row, column, num_column_tiles);
    }
  }
}

// Scales are the outer loop, so that the unit vectors of one scale stay in the cache.
void GatherPairs(const PairJob& job, const PairPanel& panel, int first, int end) {
  const int64_t row_words =
      int64_t{panel.end_column - panel.first_column} / kPairTile * 2 * job.num_scales;
  for (int scale = 0; scale < job.num_scales; ++scale) {
    for (int p = first; p < end; ++p) {
      GatherPixel(job, scale, p, panel.first_column, Min(panel.end_column, job.num_pixels),
                  panel.bits + (p - panel.first_row) * row_words + scale);
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
