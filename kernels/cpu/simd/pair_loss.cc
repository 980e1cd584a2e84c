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

// Returns the lanes of which the bit is set; lane 0 has the lowest.
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

// Returns the kLanes pixels from q on that come after p, without padding.
PEPESEG_HD LaneMask PixelsAfter(const PairJob& job, int p, int q) {
  const IntTag d;
  const auto pixel = hn::Iota(d, q);
  const auto after =
      hn::And(hn::Lt(hn::Set(d, p), pixel), hn::Lt(pixel, hn::Set(d, job.num_pixels)));
  return {hn::RebindMask(FloatTag(), after)};
}

// Returns the scales at which the labels of p and of the kLanes pixels from q on agree, as bits.
PEPESEG_HD IntLanes AgreesOf(const PairJob& job, int p, int q) {
  const uint32_t* row = job.agrees + int64_t{job.cell[p]} * job.args->num_cells;
  return hn::GatherIndex(IntTag(), reinterpret_cast<const int32_t*>(row),
                         hn::LoadU(IntTag(), job.cell + q));
}
PEPESEG_HD LaneMask AgreesAt(IntLanes agrees, int scale) {
  return {hn::RebindMask(FloatTag(), hn::TestBit(agrees, hn::Set(IntTag(), 1 << scale)))};
}

// Chooses among kLanes pixels from q on. `cosine` is that of p with the first of them, by scale.
// The rules are those of PairLossArgs: hard, drawn or wrong.
PEPESEG_HD LaneMask Choose(const PairJob& job, int p, int q, IntLanes agrees,
                           const float (*cosine)[kPairTile], int offset) {
  const IntTag d;
  const auto negative = hn::Eq(agrees, hn::Zero(d));
  const auto positive = hn::Eq(agrees, hn::Set(d, (1 << job.num_scales) - 1));
  const auto limit =
      hn::IfThenElse(negative, hn::Set(d, job.negative_limit), hn::Set(d, job.positive_limit));
  const auto hash =
      PairHash(static_cast<uint32_t>(p), static_cast<uint32_t>(q), job.args->pair_seed);
  const auto hard = hn::Not(hn::Or(negative, positive));
  LaneMask chosen = {hn::RebindMask(FloatTag(), hn::Or(hard, hn::Lt(hash, limit)))};
  const Lanes min_positive(job.args->min_positive), max_negative(job.args->max_negative);
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const LaneMask agree = AgreesAt(agrees, scale);
    const Lanes c = Lanes::Load(cosine[scale] + offset);
    chosen = chosen | (agree & (c < min_positive)) | AndNot(agree, max_negative < c);
  }
  return chosen & PixelsAfter(job, p, q);
}

// Returns the weights of the pairs of pixel p with the kLanes pixels from q on.
PEPESEG_HD Lanes PairWeights(const PairJob& job, int p, int q) {
  return MulAdd(Lanes(job.weight_slope * job.pixel_weight[p]), Lanes::Load(job.pixel_weight + q),
                Lanes(job.weight_base));
}

// The sums of a tile.
struct TileSums {
  Lanes positive = Lanes(0.0f), negative = Lanes(0.0f);
  int num_positives = 0, num_negatives = 0;
};

PEPESEG_HD void AddTo(PairBlock& block, const TileSums& sums) {
  block.sums[kNumPositives] += sums.num_positives;
  block.sums[kNumNegatives] += sums.num_negatives;
  block.sums[kPositiveLoss] += static_cast<double>(First(Total(sums.positive)));
  block.sums[kNegativeLoss] += static_cast<double>(First(Total(sums.negative)));
}

// Adds the terms of the chosen pairs of pixel p with kLanes pixels from q + offset on, at all
// scales. Sets the pairs' bits in the words of p: those of positives by scale, then those of
// negatives whose term has a gradient.
PEPESEG_HD void AddTerms(const PairJob& job, int p, int q, int offset,
                         const float (*cosine)[kPairTile], TileSums& sums, uint16_t* words) {
  const IntLanes agrees = AgreesOf(job, p, q + offset);
  const LaneMask chosen = Choose(job, p, q + offset, agrees, cosine, offset);
  if (None(chosen)) return;
  const Lanes weight = PairWeights(job, p, q + offset);
  const Lanes zero(0.0f), margin(job.args->negative_margin);
  uint16_t* negative_words = words + job.num_scales * kPairTile;
  for (int scale = 0; scale < job.num_scales; ++scale) {
    const LaneMask agree = AgreesAt(agrees, scale);
    const LaneMask positive = agree & chosen, negative = AndNot(agree, chosen);
    const Lanes c = Lanes::Load(cosine[scale] + offset);
    sums.positive = sums.positive + Select(positive, PositiveTerm(weight, c), zero);
    sums.negative = sums.negative + Select(negative, NegativeTerm(weight, c, margin), zero);
    const uint32_t positives = BitsOf(positive);
    sums.num_positives += __builtin_popcount(positives);
    sums.num_negatives += __builtin_popcount(BitsOf(negative));
    const uint32_t pushes = BitsOf(negative & (margin < c));
    words[scale * kPairTile] |= static_cast<uint16_t>(positives << offset);
    negative_words[scale * kPairTile] |= static_cast<uint16_t>(pushes << offset);
  }
}

// Chooses the pairs of pixels p and q of a tile, adds their terms, and fills the tile's words with
// the bits of those pairs of which q comes after p.
PEPESEG_HD void ChooseTile(const PairJob& job, int p, int q, PairBlock& block, uint16_t* words) {
  for (int i = 0; i < job.tile_words(); ++i) words[i] = 0;
  Cosines cosines;
  TileSums sums;
  for (int half = 0; half < kPairTile; half += kTileRows) {
    Correlate(job, p + half, q, cosines);
    for (int i = half; i < half + kTileRows && p + i < block.end; ++i) {
      for (int offset = 0; offset < kPairTile; offset += kLanes) {
        AddTerms(job, p + i, q, offset, cosines.at[i - half], sums, words + i);
      }
    }
  }
  AddTo(block, sums);
}

// Exchanges p and q in the words of a tile.
PEPESEG_HD void Transpose(const PairJob& job, const uint16_t* words, uint16_t* transposed) {
  const hn::CappedTag<uint16_t, 2 * kPairTile> d;
  constexpr int kStep = HWY_MIN(HWY_LANES(uint16_t), 2 * kPairTile);
  static_assert(kStep == kPairTile / 2 || kStep == kPairTile || kStep == 2 * kPairTile);
  for (int i = 0; i < job.tile_words(); ++i) transposed[i] = 0;
  for (int first = 0; first < job.tile_words(); first += kStep) {
    const auto in = hn::LoadU(d, words + first);
    const int shift = first % kPairTile;  // half a kind of words, if not 0
    uint16_t* out = transposed + first - shift;
    for (int j = 0; j < kPairTile; ++j) {
      uint64_t bits = 0;
      const auto bit = hn::Set(d, static_cast<uint16_t>(1u << j));
      hn::StoreMaskBits(d, hn::TestBit(in, bit), reinterpret_cast<uint8_t*>(&bits));
      out[j] |= static_cast<uint16_t>(bits << shift);
      if (kStep > kPairTile) out[kPairTile + j] |= static_cast<uint16_t>(bits >> kPairTile);
    }
  }
}

constexpr int kBitsetTiles = 4;  // tiles of q of which the bits are in one integer

// Returns the words of a pixel in `count` tiles, the first tile's in the lowest bits.
PEPESEG_HD uint64_t BitsetOf(const uint16_t* words, int tile_words, int count) {
  uint64_t bits = 0;
  for (int i = 0; i < count; ++i) bits |= uint64_t{words[i * tile_words]} << (i * kPairTile);
  return bits;
}

// Adds pairs of pixel p to its gradients at one scale.
struct PixelGradient {
  const PairJob& job;
  const float* units;  // of all pixels
  Lanes slope, base;   // of the weights of the pairs of p
  FeatureLanes positive, negative;

  PEPESEG_HD Lanes WeightOf(int q) const { return MulAdd(slope, Lanes(job.pixel_weight[q]), base); }
  PEPESEG_HD void Add(Lanes factor, int q, FeatureLanes& sum) const {
    const FeatureLanes unit = LoadFeature(units + int64_t{q} * kFeatureSize);
    HWY_UNROLL(kVectors)
    for (int k = 0; k < kVectors; ++k) sum.v[k] = MulAdd(factor, unit.v[k], sum.v[k]);
  }
  // Removes the lowest of the bits, which count from pixel q on, and adds its pair.
  PEPESEG_HD void Pull(uint64_t& bits, int q) {
    q += __builtin_ctzll(bits);
    bits &= bits - 1;
    Add(PositiveTermVjp(WeightOf(q)), q, positive);
  }
  PEPESEG_HD void Push(uint64_t& bits, int q) {
    q += __builtin_ctzll(bits);
    bits &= bits - 1;
    Add(WeightOf(q), q, negative);
  }
};

// Adds the pairs of pixel p with the pixels q of the panel, in ascending order, to its gradients at
// one scale.
PEPESEG_HD void GatherPixel(const PairJob& job, const PairPanel& panel, int scale, int p) {
  const int64_t half = int64_t{job.num_scales} * job.padded * kFeatureSize;
  float* grad = job.unit_grad + (int64_t{scale} * job.padded + p) * kFeatureSize;
  const bool begins = panel.first_column == 0;  // the first panel of a pixel
  PixelGradient sums = {job,
                        UnitOf(job, scale, 0),
                        Lanes(job.weight_slope * job.pixel_weight[p]),
                        Lanes(job.weight_base),
                        begins ? ZeroFeature() : LoadFeature(grad),
                        begins ? ZeroFeature() : LoadFeature(grad + half)};
  const int tile_words = job.tile_words();
  const uint16_t* words = panel.bits + panel.WordOf(job, p, panel.first_column) + scale * kPairTile;
  for (int q = panel.first_column; q < panel.end_column; q += kBitsetTiles * kPairTile) {
    const int count = Min(kBitsetTiles, (panel.end_column - q) / kPairTile);
    uint64_t pulls = BitsetOf(words, tile_words, count);
    uint64_t pushes = BitsetOf(words + job.num_scales * kPairTile, tile_words, count);
    // By turns, so that a sum need not wait for its own last addition.
    while (pulls != 0 && pushes != 0) {
      sums.Pull(pulls, q);
      sums.Push(pushes, q);
    }
    while (pulls != 0) sums.Pull(pulls, q);
    while (pushes != 0) sums.Push(pushes, q);
    words += kBitsetTiles * tile_words;
  }
  StoreFeature(sums.positive, grad);
  StoreFeature(sums.negative, grad + half);
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
  const PairPanel swapped = panel.Swapped();
  const int first_column = panel.diagonal() ? block.first : panel.first_column;
  for (int q = first_column; q < panel.end_column; q += kPairTile) {
    for (int p = block.first; p < block.first + kPairRows && p <= q; p += kPairTile) {
      uint16_t* words = panel.bits + panel.WordOf(job, p, q);
      ChooseTile(job, p, q, block, words);
      if (p != q) {
        Transpose(job, words, swapped.bits + swapped.WordOf(job, q, p));
        continue;
      }
      uint16_t mirrored[2 * kMaxScales * kPairTile];
      Transpose(job, words, mirrored);
      for (int i = 0; i < job.tile_words(); ++i) words[i] |= mirrored[i];
    }
  }
}

// Scales are the outer loop, so that the unit vectors of one scale stay in the cache.
void GatherPairs(const PairJob& job, const PairPanel& panel, int first, int end) {
  for (int scale = 0; scale < job.num_scales; ++scale) {
    for (int p = first; p < end; ++p) GatherPixel(job, panel, scale, p);
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
