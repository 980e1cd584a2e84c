#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include "kernels/math/adam.h"
#include "kernels/math/feature.h"
#include "tests/kernels/pair_reference.h"
#include "tests/kernels/test_scene.h"
#include "tests/system/stress/numerics/measured.h"
#include "tests/system/stress/numerics/tiny_runs.h"
#include "tests/testing/full_stress.h"

// Compares 1,000 steps of stage two, pair loss and optimiser, in single precision with the same in
// double. The double version updates every blend row at every step, so that the test also compares
// the later update of rows that the product skips (lazy rows).

namespace pepeseg::testing {
namespace {

constexpr int kNumGaussians = 60, kNumPixels = 24, kNumScales = 3, kRowLength = 3, kNumBatches = 8;
constexpr float kRate = 2.5e-3f, kBeta1 = 0.9f, kBeta2 = 0.999f;

int NumFeatureSteps() { return FullStress() ? 1'000 : 200; }

// Blend rows over some of the Gaussians, and what the pair loss needs to know of them.
struct Batch {
  PairBatch pairs;
  std::vector<int32_t> row_first, row_gaussian;
  std::vector<float> row_weight;
};

Batch RandomBatch(uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<float> uniform(0.1f, 0.4f);
  Batch batch = {RandomPairBatch(kNumPixels, kNumScales, 1, seed), {0}, {}, {}};
  const auto part = static_cast<int32_t>(random() % kNumGaussians);
  for (int p = 0; p < kNumPixels; ++p) {
    // Pixels of a mask cell see the same Gaussians, as those on one part of an object do.
    for (int e = 0; e < kRowLength; ++e) {
      const auto other = static_cast<int32_t>(random() % 5);
      batch.row_gaussian.push_back((part + 5 * batch.pairs.cell[p] + other) % kNumGaussians);
      batch.row_weight.push_back(uniform(random));
    }
    batch.row_first.push_back(static_cast<int32_t>(batch.row_gaussian.size()));
  }
  return batch;
}

// c(t) of FeatureState.
std::vector<float> Corrections() {
  std::vector<float> terms(static_cast<size_t>(NumFeatureSteps()) + 1);
  for (int t = 1; t <= NumFeatureSteps(); ++t) {
    terms[t] = static_cast<float>(std::sqrt(1 - std::pow(double{kBeta2}, t)) /
                                  (1 - std::pow(double{kBeta1}, t)));
  }
  return terms;
}

std::vector<float> Initial(int64_t count, float deviation) {
  std::vector<float> values = RandomValues(count, 5);
  for (float& value : values) value *= deviation;
  return values;
}

std::vector<float> Floats(const std::vector<double>& values) {
  return {values.begin(), values.end()};
}

double Total(const double* sums) {
  const auto mean = [](double sum, double count) { return count == 0 ? 0 : sum / count; };
  return mean(sums[kPositiveLoss], sums[kNumPositives]) +
         mean(sums[kNegativeLoss], sums[kNumNegatives]) +
         mean(sums[kNormLoss], sums[kNumNormPixels]);
}

class SingleFeatures {
 public:
  explicit SingleFeatures(Backend& backend)
      : backend_(backend),
        features_(Upload(backend, Initial(kNumGaussians * kFeatureSize, 0.3f))),
        moment1_(backend, features_.size()),
        moment2_(backend, features_.size()),
        last_step_(backend, kNumGaussians),
        gate_(Upload(backend, Initial(kGateSize, 1))),
        gate_moment1_(backend, kGateSize),
        gate_moment2_(backend, kGateSize),
        gate_grad_(backend, kGateSize),
        correction_(Upload(backend, Corrections())) {
    rates_ = {kRate, kBeta1, kBeta2, 1e-15f, correction_.span()};
  }

  double Step(const Batch& batch) {
    Buffer<int32_t> first(backend_, std::span<const int32_t>(batch.row_first));
    Buffer<int32_t> gaussian(backend_, std::span<const int32_t>(batch.row_gaussian));
    Buffer<float> weight = Upload(backend_, batch.row_weight);
    const RowSpan rows = {first.span(), gaussian.span(), weight.span()};
    Buffer<int32_t> column_gaussian, column_first, column_pixel;
    Buffer<float> column_weight;
    backend_.TransposeRows({.rows = rows,
                            .num_gaussians = kNumGaussians,
                            .gaussian = &column_gaussian,
                            .first = &column_first,
                            .pixel = &column_pixel,
                            .weight = &column_weight});
    const ColumnSpan columns = {column_gaussian.span(), column_first.span(), column_pixel.span(),
                                column_weight.span()};
    Buffer<float> pixel_features(backend_, kNumPixels * kFeatureSize);
    Buffer<float> pixel_grad(backend_, pixel_features.size());
    backend_.FeatureCatchUp({columns.gaussian, rates_, step_, State()});
    backend_.FeatureRows({rows, features_.span(), pixel_features.span()});
    const double loss = PairLossOf(batch.pairs, pixel_features, pixel_grad);
    backend_.FeatureUpdate({.columns = columns,
                            .pixel_grad = pixel_grad.span(),
                            .gate_grad = gate_grad_.span(),
                            .rates = rates_,
                            .step = ++step_,
                            .state = State(),
                            .gate = gate_.span(),
                            .gate_moment1 = gate_moment1_.span(),
                            .gate_moment2 = gate_moment2_.span()});
    backend_.Sync();  // before the batch's memory is freed
    return loss;
  }

  // Brings all rows up to date.
  std::vector<float> Features() {
    backend_.FeatureCatchUp({{}, rates_, step_, State()});
    return Download(features_);
  }

 private:
  FeatureState State() {
    return {features_.span(), moment1_.span(), moment2_.span(), last_step_.span()};
  }

  double PairLossOf(const PairBatch& pairs, const Buffer<float>& pixel_features,
                    Buffer<float>& pixel_grad) {
    const Buffer<float> weight = Upload(backend_, Floats(pairs.weight));
    const Buffer<float> alpha = Upload(backend_, Floats(pairs.alpha));
    const Buffer<float> scales = Upload(backend_, Floats(pairs.scales));
    const Buffer<int32_t> cell(backend_, std::span<const int32_t>(pairs.cell));
    const Buffer<uint64_t> labels(backend_, std::span<const uint64_t>(pairs.labels));
    Buffer<double> sums(backend_, kNumPairLossSums);
    backend_.PairLoss({.pixel_features = pixel_features.span(),
                       .pixel_weight = weight.span(),
                       .pixel_alpha = alpha.span(),
                       .pixel_cell = cell.span(),
                       .labels = labels.span(),
                       .num_cells = pairs.num_cells,
                       .label_words = pairs.label_words,
                       .scales = scales.span(),
                       .gate = gate_.span(),
                       .easy_share = 0,
                       .pair_seed = 1,
                       .pixel_grad = pixel_grad.span(),
                       .gate_grad = gate_grad_.span(),
                       .sums = sums.span()});
    return Total(Download(sums).data());
  }

  Backend& backend_;
  Buffer<float> features_, moment1_, moment2_;
  Buffer<int32_t> last_step_;
  Buffer<float> gate_, gate_moment1_, gate_moment2_, gate_grad_, correction_;
  FeatureRates rates_;
  int step_ = 0;
};

class DoubleFeatures {
 public:
  DoubleFeatures() {
    const std::vector<float> features = Initial(kNumGaussians * kFeatureSize, 0.3f);
    const std::vector<float> gate = Initial(kGateSize, 1);
    features_.assign(features.begin(), features.end());
    gate_.assign(gate.begin(), gate.end());
    moment1_.resize(features_.size() + gate_.size());
    moment2_.resize(moment1_.size());
  }

  double Step(const Batch& batch) {
    PairBatch pairs = batch.pairs;
    std::fill(pairs.features.begin(), pairs.features.end(), 0.0);
    pairs.gate = gate_;
    ForEachEntry(batch, [&](size_t pixel, size_t gaussian, double weight) {
      for (size_t k = 0; k < kFeatureSize; ++k) {
        pairs.features[pixel + k] += weight * features_[gaussian + k];
      }
    });
    const PairReference reference = ComputePairReference(pairs);
    std::vector<double> grad(features_.size());
    std::vector<bool> touched(kNumGaussians);
    ForEachEntry(batch, [&](size_t pixel, size_t gaussian, double weight) {
      touched[gaussian / kFeatureSize] = true;
      for (size_t k = 0; k < kFeatureSize; ++k) {
        grad[gaussian + k] += weight * reference.feature_grad[pixel + k];
      }
    });
    AddNormTerm(touched, grad);
    Move(grad, reference.gate_grad);
    return reference.Total();
  }

  const std::vector<double>& features() const { return features_; }

 private:
  template <class Fn>
  static void ForEachEntry(const Batch& batch, Fn&& fn) {
    for (size_t p = 0; p < kNumPixels; ++p) {
      for (int32_t e = batch.row_first[p]; e < batch.row_first[p + 1]; ++e) {
        fn(p * kFeatureSize, size_t(batch.row_gaussian[e]) * kFeatureSize,
           double{batch.row_weight[e]});
      }
    }
  }

  void AddNormTerm(const std::vector<bool>& touched, std::vector<double>& grad) const {
    const auto num = static_cast<double>(std::count(touched.begin(), touched.end(), true));
    for (size_t row = 0; row < features_.size(); row += kFeatureSize) {
      if (!touched[row / kFeatureSize]) continue;
      const double pull = NormTermVjp(features_.data() + row, kFeatureSize, 1 / num);
      for (size_t k = 0; k < kFeatureSize; ++k) grad[row + k] += pull * features_[row + k];
    }
  }

  // Rows that no step has touched have no moments, so they do not change.
  void Move(const std::vector<double>& grad, const std::vector<double>& gate_grad) {
    ++step_;
    const double correction =
        std::sqrt(1 - std::pow(double{kBeta2}, step_)) / (1 - std::pow(double{kBeta1}, step_));
    const AdamRates<double> rates = {double{kBeta1}, double{kBeta2}, 1e-15, correction, 1};
    for (size_t i = 0; i < features_.size() + gate_.size(); ++i) {
      const bool of_gate = i >= features_.size();
      double& value = of_gate ? gate_[i - features_.size()] : features_[i];
      value += AdamStep(rates, double{kRate}, of_gate ? gate_grad[i - features_.size()] : grad[i],
                        moment1_[i], moment2_[i]);
    }
  }

  std::vector<double> features_, gate_, moment1_, moment2_;
  int step_ = 0;
};

class DoubleFeatureRuns : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, DoubleFeatureRuns, CpuAndCuda(), BackendName);

TEST_P(DoubleFeatureRuns, AgreeWithFloatInStageTwo) {
  std::vector<Batch> batches;
  for (uint64_t seed = 1; seed <= kNumBatches; ++seed) batches.push_back(RandomBatch(seed));
  SingleFeatures single(*backend_);
  DoubleFeatures wide;
  double first = 0, last = 0, of_50 = 0, largest = 0;
  for (int step = 0; step < NumFeatureSteps(); ++step) {
    const Batch& batch = batches[static_cast<size_t>(step * 5) % batches.size()];
    const double loss = single.Step(batch), want = wide.Step(batch);
    if (step == 0) first = want;
    last = want;
    largest = std::max(largest, std::abs(loss - want));
    if (step < 50) of_50 = largest;
  }
  const std::vector<float> features = single.Features();
  double difference = 0, squares = 0;
  for (size_t i = 0; i < features.size(); ++i) {
    difference += std::pow(features[i] - wide.features()[i], 2);
    squares += std::pow(wide.features()[i], 2);
  }
  std::printf("features: loss %.4f -> %.4f\n", first, last);
  EXPECT_LT(last, first);
  ExpectAsMeasured(*backend_, "stage two in double: loss, 50 steps", of_50);
  ExpectAsMeasured(*backend_, "stage two in double: loss, all steps", largest);
  ExpectAsMeasured(*backend_, "stage two in double: features", std::sqrt(difference / squares));
}

}  // namespace
}  // namespace pepeseg::testing
