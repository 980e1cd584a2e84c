#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/central_differences.h"
#include "tests/kernels/pair_op.h"
#include "tests/kernels/test_scene.h"

// PairLoss against its definition in double. The draw of easy pairs, which the definition leaves to
// chance, is tested by its numbers.

namespace pepeseg {
namespace {

using Values = std::vector<double>;

Values Doubles(const std::vector<float>& values) { return {values.begin(), values.end()}; }

// Replaces the gate by one of two layers.
PairBatch WithTwoLayers(PairBatch batch) {
  batch.gate = Doubles(RandomValues(kTwoLayerGateSize, 2));
  return batch;
}

class PairLossTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, PairLossTest, AllBackends(), BackendName);

TEST_P(PairLossTest, MatchesDoubleReference) {
  for (const int num_pixels : {1, 2, 15, 40, 67}) {
    for (const bool every_pair : {false, true}) {
      if (every_pair && num_pixels < 15)
        continue;  // easy pairs are drawn only if there are hard ones
      PairBatch batch = RandomPairBatch(num_pixels, 2 + num_pixels % 9, 1 + num_pixels % 2,
                                        static_cast<uint64_t>(num_pixels));
      batch.every_pair = every_pair;
      batch.negative_margin = num_pixels % 2 == 0 ? 0.0f : 0.2f;
      batch.joint_mean = num_pixels % 2 == 0;
      const PairReference want = ComputePairReference(batch);
      const PairOpResult got = RunPairLoss(*backend_, batch, every_pair ? 1e9f : 0.0f);
      EXPECT_EQ(got.sums[kNumPositives], want.num_positives) << num_pixels;
      EXPECT_EQ(got.sums[kNumNegatives], want.num_negatives) << num_pixels;
      EXPECT_EQ(got.sums[kNumNormPixels], want.num_norm_pixels);
      EXPECT_NEAR(got.Total(), want.Total(), 2e-6 * (1 + std::abs(want.Total())));
      EXPECT_LT(RelativeError(Doubles(got.feature_grad), want.feature_grad), 2e-5) << num_pixels;
      EXPECT_LT(RelativeError(Doubles(got.gate_grad), want.gate_grad), 5e-5) << num_pixels;
    }
  }
}

// Returns the batch with its pixels in reverse order.
PairBatch Reversed(PairBatch batch) {
  const Values features = batch.features;
  const int last = batch.num_pixels - 1;
  for (int p = 0; p <= last; ++p) {
    std::copy_n(features.begin() + int64_t{last - p} * kFeatureSize, kFeatureSize,
                batch.features.begin() + int64_t{p} * kFeatureSize);
  }
  std::reverse(batch.weight.begin(), batch.weight.end());
  std::reverse(batch.alpha.begin(), batch.alpha.end());
  std::reverse(batch.cell.begin(), batch.cell.end());
  return batch;
}

// Backends keep the working memory. Other batches leave other values in it, also more and fewer of
// them.
TEST_P(PairLossTest, GivesTheSameWhateverRanBefore) {
  const PairBatch batch = RandomPairBatch(700, 10, 2, 8);
  const PairOpResult once = RunPairLoss(*backend_, batch, 0.5f);
  for (const int num_pixels : {2100, 40}) {
    RunPairLoss(*backend_, RandomPairBatch(num_pixels, 4, 1, 9), 1e9f);
    const PairOpResult again = RunPairLoss(*backend_, batch, 0.5f);
    EXPECT_EQ(once.sums, again.sums);
    EXPECT_EQ(once.feature_grad, again.feature_grad);
    EXPECT_EQ(once.gate_grad, again.gate_grad);
  }
}

// The CPU works on panels of 2048 pixels (kPairPanel). In reverse order other pixels share one.
TEST_P(PairLossTest, DoesNotDependOnTheOrderOfThousandsOfPixels) {
  constexpr int kPixels = 2100, kScales = 3;
  PairBatch batch = RandomPairBatch(kPixels, kScales, 1, 9);
  const PairOpResult got = RunPairLoss(*backend_, batch, 1e9f);
  const PairOpResult reversed = RunPairLoss(*backend_, Reversed(batch), 1e9f);
  EXPECT_EQ(got.sums[kNumPositives] + got.sums[kNumNegatives],
            kScales * 0.5 * kPixels * (kPixels - 1));
  EXPECT_EQ(got.sums[kNumPositives], reversed.sums[kNumPositives]);
  EXPECT_NEAR(got.Total(), reversed.Total(), 2e-6 * (1 + std::abs(got.Total())));
  batch.features = Doubles(got.feature_grad);
  EXPECT_LT(RelativeError(Doubles(reversed.feature_grad), Reversed(batch).features), 2e-5);
  EXPECT_LT(RelativeError(Doubles(reversed.gate_grad), Doubles(got.gate_grad)), 5e-5);
}

TEST_P(PairLossTest, MatchesDoubleReferenceWithAGateOfTwoLayers) {
  for (const int num_pixels : {15, 67}) {
    PairBatch batch = WithTwoLayers(RandomPairBatch(num_pixels, 9, 1, 3));
    batch.every_pair = true;
    const PairReference want = ComputePairReference(batch);
    const PairOpResult got = RunPairLoss(*backend_, batch, 1e9f);
    EXPECT_NEAR(got.Total(), want.Total(), 2e-6 * (1 + std::abs(want.Total())));
    EXPECT_LT(RelativeError(Doubles(got.feature_grad), want.feature_grad), 2e-5) << num_pixels;
    EXPECT_LT(RelativeError(Doubles(got.gate_grad), want.gate_grad), 5e-5) << num_pixels;
  }
}

TEST_P(PairLossTest, DrawsHalfAsManyEasyPairsAsHardOnes) {
  // Cells 0 and 1 are hard with each other. Each hard pair is positive at one of two scales, an
  // easy one counts at both.
  const double hard = 200 * 200;
  const PairOpResult got = RunPairLoss(*backend_, PatchesBatch(200, 200, 200), 0.5f);
  const double positives = (got.sums[kNumPositives] - hard) / 2;
  const double negatives = (got.sums[kNumNegatives] - hard) / 2;
  EXPECT_NEAR(positives, hard / 2, 5 * std::sqrt(hard / 2));
  EXPECT_NEAR(negatives, hard / 2, 5 * std::sqrt(hard / 2));
}

TEST_P(PairLossTest, DrawsEasyPairsWhereFewAreHard) {
  const PairOpResult got = RunPairLoss(*backend_, PatchesBatch(0, 300, 300), 0.5f);
  // No pair is hard, so 5 % of all 600 * 599 / 2 pairs count as hard.
  const double expected = 0.5 * 0.05 * 600 * 599 / 2;
  EXPECT_NEAR(got.sums[kNumPositives] / 2, expected, 5 * std::sqrt(expected));
  EXPECT_NEAR(got.sums[kNumNegatives] / 2, expected, 5 * std::sqrt(expected));
}

TEST_P(PairLossTest, DrawsAllEasyPairsAlikeForAJointMean) {
  PairBatch batch = PatchesBatch(200, 200, 300);
  batch.joint_mean = true;
  const double hard = 200 * 200;
  const PairOpResult got = RunPairLoss(*backend_, batch, 0.5f);
  const double positives = (got.sums[kNumPositives] - hard) / 2;
  const double negatives = (got.sums[kNumNegatives] - hard) / 2;
  const double same = 2 * (200 * 199 / 2.0) + 300 * 299 / 2.0, apart = 2 * 200 * 300.0;
  EXPECT_NEAR(positives + negatives, hard, 5 * std::sqrt(hard));
  EXPECT_NEAR(positives, hard * same / (same + apart), 5 * std::sqrt(hard));
}

TEST_P(PairLossTest, GivesFiniteGradientsForPixelsWithoutFeatures) {
  PairBatch batch = RandomPairBatch(20, 3, 1, 5);
  std::fill_n(batch.features.begin(), 5 * kFeatureSize, 0.0);
  const PairOpResult got = RunPairLoss(*backend_, batch, 0.5f);
  for (const float g : got.feature_grad) EXPECT_TRUE(std::isfinite(g));
  for (const float g : got.gate_grad) EXPECT_TRUE(std::isfinite(g));
}

TEST(PairLoss, GivesTheSameBytesForAnyNumberOfThreads) {
  const PairBatch batch = RandomPairBatch(150, 10, 2, 8);
  const PairOpResult one = RunPairLoss(*MakeCpuBackend(1), batch, 0.5f);
  for (const int threads : {2, 3}) {
    const PairOpResult other = RunPairLoss(*MakeCpuBackend(threads), batch, 0.5f);
    EXPECT_EQ(one.sums, other.sums);
    EXPECT_EQ(one.feature_grad, other.feature_grad);
    EXPECT_EQ(one.gate_grad, other.gate_grad);
  }
}

TEST(PairLossVjp, MatchesCentralDifferences) {
  for (const bool two_layers : {false, true}) {
    PairBatch batch = RandomPairBatch(6, 3, 1, 4);
    if (two_layers) batch = WithTwoLayers(batch);
    batch.every_pair = true;  // else a step may move a pair across a threshold
    // max(C, 0) has a corner at 0, so all cosines are kept positive.
    for (double& f : batch.features) f += 0.5;
    const PairReference got = ComputePairReference(batch);
    const auto of_features = [&](const Values& x) {
      PairBatch moved = batch;
      moved.features = x;
      return ComputePairReference(moved).Total();
    };
    const auto of_gate = [&](const Values& x) {
      PairBatch moved = batch;
      moved.gate = x;
      return ComputePairReference(moved).Total();
    };
    EXPECT_GT(got.num_negatives, 0);
    EXPECT_GT(got.num_positives, 0);
    EXPECT_LT(RelativeError(got.feature_grad, CentralDifferences(of_features, batch.features)),
              1e-6);
    EXPECT_LT(RelativeError(got.gate_grad, CentralDifferences(of_gate, batch.gate)), 1e-6);
  }
}

}  // namespace
}  // namespace pepeseg
