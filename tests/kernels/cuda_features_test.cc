#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/central_differences.h"
#include "tests/kernels/pair_op.h"
#include "tests/kernels/sparse_rows.h"

// Compares stage two on CUDA with the CPU, on batches too large for the reference.

namespace pepeseg {
namespace {

constexpr int kSize = kFeatureSize;

class CudaFeaturesTest : public CudaAndCpuTest {};

// Rows of the CPU, copied to another backend.
struct UploadedRows {
  UploadedRows(Backend& backend, const SparseRows& rows)
      : first(backend, std::span<const int32_t>(Download(rows.first))),
        gaussian(backend, std::span<const int32_t>(Download(rows.gaussian))),
        weight(Upload(backend, Download(rows.weight))) {}
  RowSpan span() const { return {first.span(), gaussian.span(), weight.span()}; }

  Buffer<int32_t> first, gaussian;
  Buffer<float> weight;
};

double Difference(const std::vector<float>& a, const std::vector<float>& b) {
  return RelativeError({a.begin(), a.end()}, {b.begin(), b.end()});
}

TEST_F(CudaFeaturesTest, DrawsTheSamePairsAsTheCpu) {
  // From few easy pairs to all of them.
  for (const auto& [easy_share, joint_mean] : {std::pair(0.5f, false),
                                               {0.01f, false},
                                               {3.0f, false},
                                               {1e9f, false},
                                               {0.5f, true},
                                               {3.0f, true}}) {
    PairBatch batch = PatchesBatch(150, 321, 240);
    batch.joint_mean = joint_mean;
    const PairOpResult want = RunPairLoss(*cpu_, batch, easy_share);
    const PairOpResult got = RunPairLoss(*cuda_, batch, easy_share);
    EXPECT_GT(want.sums[kNumPositives], 150 * 321);
    EXPECT_EQ(got.sums[kNumPositives], want.sums[kNumPositives]);
    EXPECT_EQ(got.sums[kNumNegatives], want.sums[kNumNegatives]);
    EXPECT_LT(Difference(got.feature_grad, want.feature_grad), 1e-5);
  }
}

TEST_F(CudaFeaturesTest, MatchesThePairLossOfTheCpuOnALargeBatch) {
  for (const int num_scales : {1, 10, 16}) {
    SCOPED_TRACE(num_scales);
    const PairBatch batch = RandomPairBatch(997, num_scales, 3, 40 + num_scales);
    const PairOpResult want = RunPairLoss(*cpu_, batch, 0.5f);
    const PairOpResult got = RunPairLoss(*cuda_, batch, 0.5f);
    for (const PairLossSum count : {kNumPositives, kNumNegatives}) {
      // The cosine of a few pairs rounds to the other side of a threshold.
      EXPECT_NEAR(got.sums[count], want.sums[count], 20 + 1e-5 * want.sums[count]);
      EXPECT_GT(want.sums[count], 10'000);
    }
    EXPECT_EQ(got.sums[kNumNormPixels], want.sums[kNumNormPixels]);
    EXPECT_NEAR(got.Total(), want.Total(), 1e-5 * (1 + std::abs(want.Total())));
    EXPECT_LT(Difference(got.feature_grad, want.feature_grad), 1e-4);
    EXPECT_LT(Difference(got.gate_grad, want.gate_grad), 1e-4);
  }
}

TEST_F(CudaFeaturesTest, TransposesPartOfTheRowsAsTheCpuDoes) {
  const PinholeView view = TestView(320, 200);
  const HostGaussians host = RandomScene({.count = 5'000, .max_scale = 0.1f});
  Rendered scene(*cpu_, host, view);
  const SparseRows cpu_rows(*cpu_, scene, EveryPixel(view, 17));
  const UploadedRows rows(*cuda_, cpu_rows);
  // Rows 1000 to 2499, whose first entry is not 0.
  RowSpan cpu_part = cpu_rows.span(), part = rows.span();
  cpu_part.first = cpu_part.first.Subspan(1000, 1501);
  part.first = part.first.Subspan(1000, 1501);
  const SparseColumns want(*cpu_, cpu_part, host.count), got(*cuda_, part, host.count);
  EXPECT_GT(want.gaussian.size(), 500);
  EXPECT_EQ(Download(got.gaussian), Download(want.gaussian));
  EXPECT_EQ(Download(got.first), Download(want.first));
  EXPECT_EQ(Download(got.pixel), Download(want.pixel));
  EXPECT_EQ(Download(got.weight), Download(want.weight));
}

TEST_F(CudaFeaturesTest, TransposesRowsWithoutEntriesToNothing) {
  const Buffer<int32_t> first(*cuda_, 6), gaussian(*cuda_, 0);
  const Buffer<float> weight(*cuda_, 0);
  const SparseColumns got(*cuda_, {first.span(), gaussian.span(), weight.span()}, 100);
  EXPECT_EQ(got.gaussian.size(), 0);
  EXPECT_EQ(Download(got.first), std::vector<int32_t>{0});
  EXPECT_EQ(got.pixel.size(), 0);
}

// Runs some steps of training on rows that the CPU has captured. Returns the features, then the
// gate.
std::vector<float> Train(Backend& backend, int num_steps) {
  const PinholeView view = TestView(160, 120);
  constexpr int kGaussians = 2'000;
  const auto cpu = MakeCpuBackend(1);
  Rendered scene(*cpu, RandomScene({.count = kGaussians, .max_scale = 0.1f}), view);
  const PairBatch batch = RandomPairBatch(300, 6, 1, 3);
  Buffer<float> features = Upload(backend, RandomValues(kGaussians * kSize, 1));
  Buffer<float> moment1(backend, features.size()), moment2(backend, features.size());
  Buffer<int32_t> last_step(backend, kGaussians);
  Buffer<float> gate = Upload(backend, {batch.gate.begin(), batch.gate.end()});
  Buffer<float> gate1(backend, kGateSize), gate2(backend, kGateSize), gate_grad(backend, kGateSize);
  Buffer<float> pixel_features(backend, 300 * kSize), pixel_grad(backend, 300 * kSize);
  Buffer<double> sums(backend, kNumPairLossSums);
  const Buffer<float> weight = Upload(backend, {batch.weight.begin(), batch.weight.end()});
  const Buffer<float> alpha = Upload(backend, {batch.alpha.begin(), batch.alpha.end()});
  const Buffer<float> scales = Upload(backend, {batch.scales.begin(), batch.scales.end()});
  const Buffer<int32_t> cell(backend, std::span<const int32_t>(batch.cell));
  const Buffer<uint64_t> labels(backend, std::span<const uint64_t>(batch.labels));
  const Buffer<float> correction = Upload(backend, std::vector<float>(num_steps + 1, 1.0f));
  FeatureRates rates;
  rates.correction = correction.span();
  const FeatureState state = {features.span(), moment1.span(), moment2.span(), last_step.span()};
  for (int step = 1; step <= num_steps; ++step) {
    std::vector<int32_t> pixels(300);
    for (int i = 0; i < 300; ++i) pixels[i] = (step * 4001 + i * 53) % (160 * 120);
    const SparseRows host_rows(*cpu, scene, pixels);
    const UploadedRows rows(backend, host_rows);
    const SparseColumns columns(backend, rows.span(), kGaussians);
    backend.FeatureCatchUp({columns.gaussian.span(), rates, step - 1, state});
    backend.FeatureRows({rows.span(), features.span(), pixel_features.span()});
    backend.PairLoss({.pixel_features = pixel_features.span(),
                      .pixel_weight = weight.span(),
                      .pixel_alpha = alpha.span(),
                      .pixel_cell = cell.span(),
                      .labels = labels.span(),
                      .num_cells = batch.num_cells,
                      .label_words = batch.label_words,
                      .scales = scales.span(),
                      .gate = gate.span(),
                      .pair_seed = static_cast<uint32_t>(step),
                      .pixel_grad = pixel_grad.span(),
                      .gate_grad = gate_grad.span(),
                      .sums = sums.span()});
    backend.FeatureUpdate({.columns = columns.span(),
                           .pixel_grad = pixel_grad.span(),
                           .gate_grad = gate_grad.span(),
                           .rates = rates,
                           .step = step,
                           .state = state,
                           .gate = gate.span(),
                           .gate_moment1 = gate1.span(),
                           .gate_moment2 = gate2.span()});
  }
  backend.FeatureCatchUp({{}, rates, num_steps, state});
  std::vector<float> out = Download(features);
  const std::vector<float> trained_gate = Download(gate);
  out.insert(out.end(), trained_gate.begin(), trained_gate.end());
  return out;
}

TEST_F(CudaFeaturesTest, TrainsAsTheCpuDoes) {
  constexpr int kSteps = 12;
  const std::vector<float> want = Train(*cpu_, kSteps), got = Train(*cuda_, kSteps);
  ASSERT_EQ(got.size(), want.size());
  // Adam takes a step of full length however small the gradient is. Where the gradient is only
  // rounding, the step may have either sign.
  size_t num_apart = 0;
  double mean = 0;
  for (size_t i = 0; i < want.size(); ++i) {
    const double difference = double{got[i]} - want[i];
    num_apart += std::abs(difference) > 2e-4 ? 1 : 0;
    mean += difference / static_cast<double>(want.size());
    ASSERT_LT(std::abs(difference), 2 * kSteps * 2.5e-3) << i;
  }
  EXPECT_LT(static_cast<double>(num_apart), 5e-3 * static_cast<double>(want.size()));
  EXPECT_LT(std::abs(mean), 1e-6);
  EXPECT_GT(Difference(want, Train(*cpu_, 0)), 1e-3);  // training has moved the features
}

TEST_F(CudaFeaturesTest, TrainsToTheSameBytesEachTime) {
  EXPECT_EQ(Train(*cuda_, 4), Train(*cuda_, 4));
}

}  // namespace
}  // namespace pepeseg
