#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "kernels/math/gate.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/central_differences.h"
#include "tests/kernels/test_scene.h"

// CentroidLoss against its definition in double, whose gradient is found by central differences.

namespace pepeseg {
namespace {

using Values = std::vector<double>;
constexpr int kSize = kFeatureSize, kPixels = 90, kCentroids = 40;
constexpr double kScale = 0.7, kWeight = 0.3, kMinCosine = 0.55;

class CentroidLossTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, CentroidLossTest, AllBackends(), BackendName);

// Random centroids of length 1.
Values Centroids() {
  const std::vector<float> values = RandomValues(kCentroids * kSize, 4);
  Values centroids(values.begin(), values.end());
  for (int k = 0; k < kCentroids; ++k) {
    double* c = centroids.data() + k * kSize;
    const double length = std::sqrt(std::inner_product(c, c + kSize, c, 0.0));
    for (int i = 0; i < kSize; ++i) c[i] /= length;
  }
  return centroids;
}

// psi of a gate of either number of layers.
Values PsiOf(const Values& gate) {
  Values psi(kSize);
  GateAt(GateNumbers<double>{gate.data(), static_cast<int64_t>(gate.size())}, kSize, kScale,
         psi.data());
  return psi;
}

// Features of the pixels, then the gate. Once gated, every other pixel is near a centroid.
Values PixelsAndGate(int gate_size = kGateSize) {
  const std::vector<float> noise = RandomValues(kPixels * kSize, 5);
  const std::vector<float> gate = RandomValues(gate_size, 6);
  const Values psi = PsiOf({gate.begin(), gate.end()});
  const Values centroids = Centroids();
  Values x(noise.begin(), noise.end());
  x.insert(x.end(), gate.begin(), gate.end());
  for (int p = 0; p < kPixels; p += 2) {
    for (int i = 0; i < kSize; ++i) {
      x[p * kSize + i] =
          centroids[p % kCentroids * kSize + i] / psi[i] + 0.1 * noise[p * kSize + i];
    }
  }
  return x;
}

// The loss in double, from its definition.
struct Reference {
  double loss = 0;  // mean, times the weight
  int num_near = 0;
};
// x holds the features of the pixels, then the gate.
Reference Evaluate(const Values& x) {
  const Values centroids = Centroids();
  const Values psi = PsiOf({x.begin() + kPixels * kSize, x.end()});
  Reference sum;
  for (int p = 0; p < kPixels; ++p) {
    Values gated(kSize);
    for (int i = 0; i < kSize; ++i) {
      gated[i] = psi[i] * x[p * kSize + i];
    }
    const double length =
        std::sqrt(std::inner_product(gated.begin(), gated.end(), gated.begin(), 0.0));
    double best = kMinCosine;
    for (int k = 0; k < kCentroids; ++k) {
      best = std::max(
          best, std::inner_product(gated.begin(), gated.end(), centroids.begin() + k * kSize, 0.0) /
                    length);
    }
    if (best == kMinCosine) continue;
    sum.loss += kWeight * (1 - best);
    ++sum.num_near;
  }
  if (sum.num_near > 0) sum.loss /= sum.num_near;
  return sum;
}

struct Result {
  Values grad;  // of the pixels, then the gate; less `start`
  std::vector<double> sums;
};
// Runs the op with gradients that hold `start` beforehand.
Result RunOp(Backend& backend, const Values& x, float min_cosine, float start) {
  const Values centroid_values = Centroids();
  const Buffer<float> features = Upload(backend, {x.begin(), x.begin() + kPixels * kSize});
  const Buffer<float> gate = Upload(backend, {x.begin() + kPixels * kSize, x.end()});
  const Buffer<float> centroids = Upload(backend, {centroid_values.begin(), centroid_values.end()});
  Buffer<float> pixel_grad = Upload(backend, std::vector<float>(kPixels * kSize, start));
  Buffer<float> gate_grad = Upload(backend, std::vector<float>(gate.size(), start));
  Buffer<double> sums(backend, kNumCentroidSums);
  backend.CentroidLoss({.pixel_features = features.span(),
                        .centroids = centroids.span(),
                        .gate = gate.span(),
                        .scale = static_cast<float>(kScale),
                        .min_cosine = min_cosine,
                        .weight = static_cast<float>(kWeight),
                        .pixel_grad = pixel_grad.span(),
                        .gate_grad = gate_grad.span(),
                        .sums = sums.span()});
  Result result = {{}, Download(sums)};
  for (const float g : Download(pixel_grad)) result.grad.push_back(double{g} - double{start});
  for (const float g : Download(gate_grad)) result.grad.push_back(double{g} - double{start});
  return result;
}

TEST_P(CentroidLossTest, MatchesTheFormulaAndCentralDifferences) {
  for (const int gate_size : {kGateSize, kTwoLayerGateSize}) {
    const Values x = PixelsAndGate(gate_size);
    const Reference want = Evaluate(x);
    // All pixels placed near a centroid are near one, and some others are not.
    ASSERT_GT(want.num_near, kPixels / 2 - 1);
    ASSERT_LT(want.num_near, kPixels);
    const Result got = RunOp(*backend_, x, kMinCosine, 0);
    EXPECT_EQ(got.sums[kNumNearCentroids], want.num_near);
    EXPECT_NEAR(kWeight * got.sums[kCentroidLoss] / want.num_near, want.loss, 1e-6);
    const Values grad = CentralDifferences([](const Values& v) { return Evaluate(v).loss; }, x);
    EXPECT_LT(RelativeError(got.grad, grad), 1e-5) << gate_size;
  }
}

TEST_P(CentroidLossTest, AddsToTheGradients) {
  const Values x = PixelsAndGate();
  const Result alone = RunOp(*backend_, x, kMinCosine, 0),
               added = RunOp(*backend_, x, kMinCosine, 1);
  EXPECT_LT(RelativeError(added.grad, alone.grad), 1e-3);  // added to 1, few digits are left
}

TEST_P(CentroidLossTest, LeavesFarPixelsAlone) {
  const Result got = RunOp(*backend_, PixelsAndGate(), 0.99999f, 0);
  EXPECT_EQ(got.sums, (std::vector<double>{0, 0}));
  for (const double g : got.grad) ASSERT_EQ(g, 0);
}

}  // namespace
}  // namespace pepeseg
