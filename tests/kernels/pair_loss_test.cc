#include <gtest/gtest.h>

#include <cmath>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/central_differences.h"
#include "tests/kernels/pair_reference.h"
#include "tests/kernels/test_scene.h"

namespace pepeseg {
namespace {

using Values = std::vector<double>;

struct OpResult {
  std::vector<double> sums = std::vector<double>(kNumPairLossSums);
  std::vector<float> feature_grad, gate_grad;

  double Total() const {
    const auto mean = [&](int sum, int count) {
      return sums[count] == 0 ? 0 : sums[sum] / sums[count];
    };
    return mean(kPositiveLoss, kNumPositives) + mean(kNegativeLoss, kNumNegatives) +
           mean(kNormLoss, kNumNormPixels);
  }
};

std::vector<float> Floats(const Values& values) { return {values.begin(), values.end()}; }
Values Doubles(const std::vector<float>& values) { return {values.begin(), values.end()}; }

OpResult RunOp(Backend& backend, const PairBatch& batch, float easy_share) {
  const Buffer<float> features = Upload(backend, Floats(batch.features));
  const Buffer<float> weight = Upload(backend, Floats(batch.weight));
  const Buffer<float> alpha = Upload(backend, Floats(batch.alpha));
  const Buffer<float> scales = Upload(backend, Floats(batch.scales));
  const Buffer<float> gate = Upload(backend, Floats(batch.gate));
  const Buffer<int32_t> patch(backend, std::span<const int32_t>(batch.patch));
  const Buffer<uint64_t> labels(backend, std::span<const uint64_t>(batch.labels));
  Buffer<float> pixel_grad(backend, features.size()), gate_grad(backend, kGateSize);
  Buffer<double> sums(backend, kNumPairLossSums);
  PairLossArgs args;
  args.pixel_features = features.span();
  args.pixel_weight = weight.span();
  args.pixel_alpha = alpha.span();
  args.pixel_patch = patch.span();
  args.labels = labels.span();
  args.num_patches = batch.num_patches;
  args.label_words = batch.label_words;
  args.scales = scales.span();
  args.gate = gate.span();
  args.easy_share = easy_share;
  args.pair_seed = 17;
  args.pixel_grad = pixel_grad.span();
  args.gate_grad = gate_grad.span();
  args.sums = sums.span();
  backend.PairLoss(args);
  OpResult out;
  sums.Download(out.sums);
  out.feature_grad = Download(pixel_grad);
  out.gate_grad = Download(gate_grad);
  return out;
}

class PairLossTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, PairLossTest, CpuBackends(), BackendName);

TEST_P(PairLossTest, MatchesDoubleReference) {
  for (const int num_pixels : {1, 2, 15, 40, 67}) {
    for (const bool every_pair : {false, true}) {
      if (every_pair && num_pixels < 15) continue;  // easy pairs come with hard ones
      PairBatch batch = RandomPairBatch(num_pixels, 2 + num_pixels % 9, 1 + num_pixels % 2,
                                        static_cast<uint64_t>(num_pixels));
      batch.every_pair = every_pair;
      const PairReference want = ComputePairReference(batch);
      const OpResult got = RunOp(*backend_, batch, every_pair ? 1e9f : 0.0f);
      EXPECT_EQ(got.sums[kNumPositives], want.num_positives) << num_pixels;
      EXPECT_EQ(got.sums[kNumNegatives], want.num_negatives) << num_pixels;
      EXPECT_EQ(got.sums[kNumNormPixels], want.num_norm_pixels);
      EXPECT_NEAR(got.Total(), want.Total(), 2e-6 * (1 + std::abs(want.Total())));
      EXPECT_LT(RelativeError(Doubles(got.feature_grad), want.feature_grad), 2e-5) << num_pixels;
      EXPECT_LT(RelativeError(Doubles(got.gate_grad), want.gate_grad), 5e-5) << num_pixels;
    }
  }
}

// Pixels of three patches: 0 and 1 agree at one of two scales, 2 with nothing, each with itself
// always. Nothing violates: features are equal within a patch and orthogonal between them.
PairBatch PatchesBatch(int size0, int size1, int size2) {
  const int num_pixels = size0 + size1 + size2;
  PairBatch batch = RandomPairBatch(num_pixels, 2, 1, 5);
  batch.num_patches = 3;
  batch.labels = {1, 1, 2, 1, 4, 2};
  for (int i = 0; i < num_pixels; ++i) {
    batch.patch[i] = i < size0 ? 0 : (i < size0 + size1 ? 1 : 2);
    for (int k = 0; k < kFeatureSize; ++k) {
      batch.features[i * kFeatureSize + k] = k == batch.patch[i] ? 1 : 0;
    }
  }
  return batch;
}

TEST_P(PairLossTest, DrawsHalfAsManyEasyPairsAsHardOnes) {
  const double hard = 200 * 200;
  const OpResult got = RunOp(*backend_, PatchesBatch(200, 200, 200), 0.5f);
  const double positives = (got.sums[kNumPositives] - hard) / 2;
  const double negatives = (got.sums[kNumNegatives] - hard) / 2;
  EXPECT_NEAR(positives, hard / 2, 5 * std::sqrt(hard / 2));
  EXPECT_NEAR(negatives, hard / 2, 5 * std::sqrt(hard / 2));
}

TEST_P(PairLossTest, DrawsEasyPairsWhereFewAreHard) {
  const OpResult got = RunOp(*backend_, PatchesBatch(0, 300, 300), 0.5f);
  const double expected = 0.5 * 0.05 * 600 * 599 / 2;
  EXPECT_NEAR(got.sums[kNumPositives] / 2, expected, 5 * std::sqrt(expected));
  EXPECT_NEAR(got.sums[kNumNegatives] / 2, expected, 5 * std::sqrt(expected));
}

TEST_P(PairLossTest, PixelsWithoutAnyFeatureHaveFiniteGradients) {
  PairBatch batch = RandomPairBatch(20, 3, 1, 5);
  std::fill_n(batch.features.begin(), 5 * kFeatureSize, 0.0);
  const OpResult got = RunOp(*backend_, batch, 0.5f);
  for (const float g : got.feature_grad) EXPECT_TRUE(std::isfinite(g));
  for (const float g : got.gate_grad) EXPECT_TRUE(std::isfinite(g));
}

TEST(PairLoss, SameBytesForAnyNumberOfThreads) {
  const PairBatch batch = RandomPairBatch(150, 10, 2, 8);
  const OpResult one = RunOp(*MakeCpuBackend(1), batch, 0.5f);
  for (const int threads : {2, 3}) {
    const OpResult other = RunOp(*MakeCpuBackend(threads), batch, 0.5f);
    EXPECT_EQ(one.sums, other.sums);
    EXPECT_EQ(one.feature_grad, other.feature_grad);
    EXPECT_EQ(one.gate_grad, other.gate_grad);
  }
}

TEST(PairLossVjp, MatchesCentralDifferences) {
  PairBatch batch = RandomPairBatch(6, 3, 1, 4);
  batch.every_pair = true;  // else a step may move a pair across a threshold
  // Where a cosine changes its sign, max(C, 0) has a corner: keep them positive.
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
  EXPECT_LT(RelativeError(got.feature_grad, CentralDifferences(of_features, batch.features)), 1e-6);
  EXPECT_LT(RelativeError(got.gate_grad, CentralDifferences(of_gate, batch.gate)), 1e-6);
}

}  // namespace
}  // namespace pepeseg
