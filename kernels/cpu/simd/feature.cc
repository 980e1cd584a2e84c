#include "kernels/math/feature.h"

#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/lanes.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/math/adam.h"

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

// What k steps without a gradient do to a row, see FeatureState.
struct Replay {
  double move;            // the sum over j in that comment
  double decay1, decay2;  // beta^k
};
// For the steps after last_step up to `step`. The sum and decay1 are cut after kMaxReplay steps;
// decay2 is near 1 and needs them all.
Replay ReplayOf(const FeatureRates& rates, int last_step, int step) {
  const double beta1 = static_cast<double>(rates.beta1), beta2 = static_cast<double>(rates.beta2);
  const double ratio = beta1 / __builtin_sqrt(beta2);
  const int count = Min(step - last_step, kMaxReplay);
  Replay replay = {0, 1, 1};
  double term = 1;
  for (int j = 1; j <= count; ++j) {
    term *= ratio;
    replay.move += term * static_cast<double>(rates.correction.data[last_step + j]);
    replay.decay1 *= beta1;
    replay.decay2 *= beta2;
  }
  if (step - last_step > count) replay.decay2 = __builtin_pow(beta2, step - last_step);
  return replay;
}

// Brings one row up to date with args.step.
PEPESEG_HD void CatchUpRow(const FeatureCatchUpArgs& args, int64_t gaussian) {
  const FeatureState& state = args.state;
  int32_t& last_step = state.last_step.data[gaussian];
  // A row that was never updated has no moments, so nothing moves it.
  if (last_step > 0 && last_step < args.step) {
    const Replay replay = ReplayOf(args.rates, last_step, args.step);
    const Lanes move(static_cast<float>(-replay.move) * args.rates.learning_rate);
    const Lanes decay1(static_cast<float>(replay.decay1));
    const Lanes decay2(static_cast<float>(replay.decay2));
    for (int k = 0; k < kFeatureSize; k += kLanes) {
      const int64_t i = gaussian * kFeatureSize + k;
      const Lanes moment1 = Lanes::Load(state.moment1.data + i);
      const Lanes moment2 = Lanes::Load(state.moment2.data + i);
      const Lanes direction = moment1 / (Sqrt(moment2) + Lanes(args.rates.epsilon));
      MulAdd(move, direction, Lanes::Load(state.features.data + i)).Store(state.features.data + i);
      (decay1 * moment1).Store(state.moment1.data + i);
      (decay2 * moment2).Store(state.moment2.data + i);
    }
  }
  last_step = args.step;
}

}  // namespace

void FeatureCatchUpRange(const FeatureCatchUpArgs& args, FeatureRange range) {
  const bool every = args.gaussian.size == 0;
  for (int64_t i = range.first; i < range.end; ++i) {
    CatchUpRow(args, every ? i : args.gaussian.data[i]);
  }
}

// Reads the weights of the rows, which must have them.
void FeatureRowsRange(const FeatureRowsArgs& args, FeatureRange range) {
  for (int64_t p = range.first; p < range.end; ++p) {
    FeatureLanes sum = ZeroFeature();
    for (int32_t e = args.rows.first.data[p]; e < args.rows.first.data[p + 1]; ++e) {
      AddScaled(args.rows.weight.data[e],
                args.features.data + int64_t{args.rows.gaussian.data[e]} * kFeatureSize, sum);
    }
    StoreFeature(sum, args.pixel_features.data + p * kFeatureSize);
  }
}

// For each touched Gaussian: gathers the gradient from its column, passes it through the direction
// if asked, adds the norm term and applies Adam.
void FeatureUpdateRange(const FeatureUpdateArgs& args, FeatureRange range) {
  const AdamRates<Lanes> rates = {Lanes(args.rates.beta1), Lanes(args.rates.beta2),
                                  Lanes(args.rates.epsilon),
                                  Lanes(args.rates.correction.data[args.step]), Lanes(1.0f)};
  const Lanes norm_scale(args.norm_weight / static_cast<float>(args.columns.gaussian.size));
  const Lanes learning_rate(args.rates.learning_rate);
  const FeatureState& state = args.state;
  for (int64_t i = range.first; i < range.end; ++i) {
    FeatureLanes grad = GatherColumn(args.columns, i, args.pixel_grad.data);
    const int64_t gaussian = args.columns.gaussian.data[i];
    const int64_t row = gaussian * kFeatureSize;
    FeatureLanes feature = LoadFeature(state.features.data + row);
    FeatureLanes moment1 = LoadFeature(state.moment1.data + row);
    FeatureLanes moment2 = LoadFeature(state.moment2.data + row);
    if (args.of_direction) {
      FeatureLanes direction;
      const Lanes inv_length = Direction(feature.v, kVectors, direction.v);
      DirectionVjp(direction.v, inv_length, kVectors, grad.v);
    }
    const Lanes pull = NormTermVjp(feature.v, kVectors, norm_scale);
    for (int k = 0; k < kVectors; ++k) {
      const Lanes sum = MulAdd(pull, feature.v[k], grad.v[k]);
      feature.v[k] = feature.v[k] + AdamStep(rates, learning_rate, sum, moment1.v[k], moment2.v[k]);
    }
    StoreFeature(feature, state.features.data + row);
    StoreFeature(moment1, state.moment1.data + row);
    StoreFeature(moment2, state.moment2.data + row);
    state.last_step.data[gaussian] = args.step;
  }
}

// A pixel at a time against all queries, which stay in the cache.
void SimilarityRange(const SimilarityArgs& args, const float* query_units, FeatureRange range) {
  const hn::Rebind<hwy::float16_t, FloatTag> half_tag;
  const FeatureLanes psi = LoadFeature(args.psi.data);
  const int64_t num_pixels = args.map.size / kFeatureSize;
  const int64_t num_queries = args.queries.size / kFeatureSize;
  const auto* map = reinterpret_cast<const hwy::float16_t*>(args.map.data);
  for (int64_t p = range.first; p < range.end; ++p) {
    FeatureLanes feature, unit;
    for (int k = 0; k < kVectors; ++k) {
      const auto* at = map + p * kFeatureSize + k * kLanes;
      feature.v[k] = Lanes(hn::PromoteTo(FloatTag(), hn::LoadU(half_tag, at)));
    }
    Lanes squares(0.0f);
    for (int k = 0; k < kVectors; ++k) squares = MulAdd(feature.v[k], feature.v[k], squares);
    if (First(Total(squares)) < args.min_norm * args.min_norm) {
      for (int64_t query = 0; query < num_queries; ++query) {
        args.similarity.data[query * num_pixels + p] = 0;
      }
      continue;
    }
    GatedUnit(psi.v, feature.v, kVectors, unit.v);
    for (int64_t query = 0; query < num_queries; ++query) {
      Lanes sum(0.0f);
      for (int k = 0; k < kVectors; ++k) {
        const Lanes other = Lanes::Load(query_units + query * kFeatureSize + k * kLanes);
        sum = MulAdd(unit.v[k], other, sum);
      }
      args.similarity.data[query * num_pixels + p] = First(Total(sum));
    }
  }
}

// Adds the directions of the drawn neighbours in the order of the columns, and normalises the sum.
void SmoothFeaturesRange(const SmoothFeaturesArgs& args, FeatureRange range) {
  const bool every = args.gaussian.size == 0;
  for (int64_t i = range.first; i < range.end; ++i) {
    const int64_t gaussian = every ? i : args.gaussian.data[i];
    const int32_t* neighbors = args.graph.neighbor.data + gaussian * args.graph.num_neighbors;
    FeatureLanes sum = ZeroFeature();
    for (uint32_t left = args.drawn; left != 0; left &= left - 1) {
      const int64_t neighbor = neighbors[__builtin_ctz(left)];
      const FeatureLanes feature = LoadFeature(args.features.data + neighbor * kFeatureSize);
      FeatureLanes direction;
      Direction(feature.v, kVectors, direction.v);
      HWY_UNROLL(kVectors)
      for (int k = 0; k < kVectors; ++k) sum.v[k] = sum.v[k] + direction.v[k];
    }
    FeatureLanes smoothed;
    args.inv_length.data[gaussian] = First(Direction(sum.v, kVectors, smoothed.v));
    StoreFeature(smoothed, args.smoothed.data + gaussian * kFeatureSize);
  }
}

// Gathers d loss / d fbar from the pixels of each column and passes it through the normalisation.
void SmoothBackwardRange(const SmoothBackwardArgs& args, FeatureRange range) {
  for (int64_t i = range.first; i < range.end; ++i) {
    FeatureLanes grad = GatherColumn(args.columns, i, args.pixel_grad.data);
    const int64_t gaussian = args.columns.gaussian.data[i];
    const FeatureLanes smoothed = LoadFeature(args.smoothed.data + gaussian * kFeatureSize);
    DirectionVjp(smoothed.v, Lanes(args.inv_length.data[gaussian]), kVectors, grad.v);
    StoreFeature(grad, args.sum_grad.data + i * kFeatureSize);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
