#include "core/features/feature_trainer.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace pepeseg {
namespace {

constexpr float kInitialDeviation = 0.01f;

// c(t) of FeatureState's comment, for t up to num_steps.
std::vector<float> Corrections(const FeatureRates& rates, int num_steps) {
  std::vector<float> terms(num_steps + 1);
  double power1 = 1, power2 = 1;
  for (int t = 1; t <= num_steps; ++t) {
    power1 *= double{rates.beta1};
    power2 *= double{rates.beta2};
    terms[t] = static_cast<float>(std::sqrt(1 - power2) / (1 - power1));
  }
  return terms;
}

// Twelve uniforms make a normal that is the same with every standard library.
std::vector<float> NormalNumbers(int64_t count, float deviation, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<float> numbers(count);
  for (float& number : numbers) {
    double sum = -6;
    for (int k = 0; k < 6; ++k) {
      const uint64_t bits = random();
      sum += static_cast<double>(bits >> 32) * 0x1p-32;
      sum += static_cast<double>(bits & 0xffffffffu) * 0x1p-32;
    }
    number = deviation * static_cast<float>(sum);
  }
  return numbers;
}

template <class T>
void UploadTo(Backend& backend, const std::vector<T>& values, Buffer<T>& buffer) {
  buffer.Reserve(backend, static_cast<int64_t>(values.size()));
  buffer.Upload(std::span<const T>(values));
}

}  // namespace

FeatureTrainer::FeatureTrainer(Backend& backend, int64_t num_gaussians,
                               const FeatureOptions& options)
    : backend_(backend),
      num_gaussians_(num_gaussians),
      features_(backend, num_gaussians * kFeatureSize),
      moment1_(backend, num_gaussians * kFeatureSize),
      moment2_(backend, num_gaussians * kFeatureSize),
      last_step_(backend, num_gaussians),
      gate_(backend, kGateSize),
      gate_moment1_(backend, kGateSize),
      gate_moment2_(backend, kGateSize),
      gate_grad_(backend, kGateSize),
      pixel_features_(backend, int64_t{options.num_pixels} * kFeatureSize),
      pixel_grad_(backend, int64_t{options.num_pixels} * kFeatureSize),
      sums_(backend, kNumPairLossSums) {
  rates_.learning_rate = options.learning_rate;
  UploadTo(backend, Corrections(rates_, options.num_steps), correction_);
  rates_.correction = correction_.span();
  // Apart from the sampler's stream.
  const uint64_t seed = options.seed ^ 0x9e3779b97f4a7c15u;
  features_.Upload(NormalNumbers(features_.size(), kInitialDeviation, seed));
  gate_.Upload(NormalNumbers(kGateSize, 1, seed + 1));
}

void FeatureTrainer::Upload(const PixelBatch& batch) {
  UploadTo(backend_, batch.weight, pixel_weight_);
  UploadTo(backend_, batch.patch, patch_);
  UploadTo(backend_, batch.labels, labels_);
  UploadTo(backend_, batch.scales, scales_);
}

double FeatureTrainer::Train(const RowChunk::Step& step) {
  const PixelBatch& batch = *step.batch;
  Upload(batch);
  backend_.TransposeRows({.rows = step.rows,
                          .num_gaussians = num_gaussians_,
                          .gaussian = &column_gaussian_,
                          .first = &column_first_,
                          .pixel = &column_pixel_,
                          .weight = &column_weight_});
  if (!column_gaussian_.empty()) {
    backend_.FeatureCatchUp({column_gaussian_.span(), rates_, step_, State()});
  }
  backend_.FeatureRows({step.rows, features_.span(), pixel_features_.span()});
  backend_.PairLoss({.pixel_features = pixel_features_.span(),
                     .pixel_weight = pixel_weight_.span(),
                     .pixel_alpha = step.alpha,
                     .pixel_patch = patch_.span(),
                     .labels = labels_.span(),
                     .num_patches = batch.num_patches,
                     .label_words = batch.label_words,
                     .scales = scales_.span(),
                     .gate = gate_.span(),
                     .pair_seed = batch.pair_seed,
                     .pixel_grad = pixel_grad_.span(),
                     .gate_grad = gate_grad_.span(),
                     .sums = sums_.span()});
  backend_.FeatureUpdate({.columns = Columns(),
                          .pixel_grad = pixel_grad_.span(),
                          .gate_grad = gate_grad_.span(),
                          .rates = rates_,
                          .step = ++step_,
                          .state = State(),
                          .gate = gate_.span(),
                          .gate_moment1 = gate_moment1_.span(),
                          .gate_moment2 = gate_moment2_.span()});
  double sums[kNumPairLossSums];
  sums_.Download(sums);
  const auto mean = [&](PairLossSum sum, PairLossSum count) {
    return sums[count] == 0 ? 0.0 : sums[sum] / sums[count];
  };
  return mean(kPositiveLoss, kNumPositives) + mean(kNegativeLoss, kNumNegatives) +
         mean(kNormLoss, kNumNormPixels);
}

void FeatureTrainer::Export(FeatureField& field) {
  backend_.FeatureCatchUp({{}, rates_, step_, State()});
  field.features.resize(features_.size());
  features_.Download(field.features);
  std::vector<float> moment2(moment2_.size());
  moment2_.Download(std::span<float>(moment2));
  for (int64_t i = 0; i < num_gaussians_; ++i) {
    const std::span<float> row(field.features.data() + i * kFeatureSize, kFeatureSize);
    const std::span<const float> seen(moment2.data() + i * kFeatureSize, kFeatureSize);
    double squares = 0;
    for (const float value : row) squares += double{value} * value;
    const bool touched = std::any_of(seen.begin(), seen.end(), [](float m) { return m > 0; });
    const auto scale = static_cast<float>(touched && squares > 0 ? 1 / std::sqrt(squares) : 0);
    for (float& value : row) value *= scale;
  }
  gate_.Download(std::span<float>(field.gate));
}

}  // namespace pepeseg
