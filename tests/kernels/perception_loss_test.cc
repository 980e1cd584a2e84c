#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numeric>
#include <random>

#include "kernels/math/gate.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/central_differences.h"
#include "tests/kernels/test_scene.h"

// PerceptionLoss against its formula in double, whose gradient is found by central differences.

namespace pepeseg {
namespace {

using Values = std::vector<double>;
constexpr int kSize = kFeatureSize, kPixels = 70, kScales = 5;
constexpr double kWeight = 0.3;
constexpr std::array<float, kScales> kQuantiles = {0.9f, 0, 0.35f, 1.2f, 0.6f};

class PerceptionLossTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, PerceptionLossTest, AllBackends(), BackendName);

struct Pair {
  int p, q;
  PairCues cues;
};

// Random pairs and cues. Every tenth pixel has no pair, no pair is dissimilar at scale 1, and none
// has a cue at scale 3.
std::vector<Pair> RandomPairs() {
  std::mt19937 random(3);
  std::vector<Pair> pairs;
  for (int p = 0; p < kPixels; ++p) {
    for (int q = p + 1; q < kPixels; ++q) {
      if (p % 10 == 7 || q % 10 == 7 || random() % 8 != 0) continue;
      Pair pair = {p, q, 0};
      for (int k = 0; k < kScales; ++k) {
        const uint32_t draw = random() % 3;
        if (draw == 0 && k != 3) pair.cues |= 1u << k;
        if (draw == 1 && k != 3 && k != 1) pair.cues |= 1u << (kDissimilarShift + k);
      }
      pairs.push_back(pair);
    }
  }
  return pairs;
}

// Features of the pixels, then the gate.
Values RandomInput(int gate_size = kGateSize) {
  const std::vector<float> values = RandomValues(kPixels * kSize + gate_size, 8);
  return {values.begin(), values.end()};
}

// psi at a scale, from its formula.
Values PsiOf(const Values& x, double scale) {
  const double* gate = x.data() + kPixels * kSize;
  Values psi(kSize);
  for (int i = 0; i < kSize; ++i) {
    double logit = gate[i] * scale + gate[kSize + i];
    if (x.size() == kPixels * kSize + kTwoLayerGateSize) {
      logit = gate[kTwoLayerGateSize - kSize + i];
      for (int j = 0; j < 32; ++j) {
        logit += gate[64 + j * kSize + i] * std::max(0.0, gate[j] * scale + gate[32 + j]);
      }
    }
    psi[i] = 1 / (1 + std::exp(-logit));
  }
  return psi;
}

// Cosine of the features of two pixels, gated by psi.
double CosineOf(const Values& x, int p, int q, const Values& psi) {
  double pq = 0, pp = 0, qq = 0;
  for (int i = 0; i < kSize; ++i) {
    const double a = psi[i] * x[p * kSize + i], b = psi[i] * x[q * kSize + i];
    pq += a * b;
    pp += a * a;
    qq += b * b;
  }
  return pq / std::sqrt(pp * qq);
}

// L_p in double, straight from the formula.
double Loss(const Values& x, const std::vector<Pair>& pairs) {
  double loss = 0;
  for (int k = 0; k < kScales; ++k) {
    double similar = 0, dissimilar = 0;
    int num_similar = 0, num_dissimilar = 0;
    const Values psi = PsiOf(x, double{kQuantiles[k]});
    for (const Pair& pair : pairs) {
      const double cosine = CosineOf(x, pair.p, pair.q, psi);
      if ((pair.cues >> k & 1) != 0) {
        similar += 1 - cosine;
        ++num_similar;
      } else if ((pair.cues >> (kDissimilarShift + k) & 1) != 0) {
        dissimilar += std::max(cosine, 0.0);
        ++num_dissimilar;
      }
    }
    if (num_similar > 0) loss += similar / num_similar / kScales;
    if (num_dissimilar > 0) loss += dissimilar / num_dissimilar / kScales;
  }
  return loss;
}

// The pairs as PerceptionLossArgs takes them.
struct Lists {
  std::vector<int32_t> first = {0}, other;
  std::vector<PairCues> cues;
  std::vector<float> share = std::vector<float>(2 * kScales);
};
Lists ListPairs(const std::vector<Pair>& pairs) {
  Lists lists;
  for (int p = 0; p < kPixels; ++p) {
    for (const Pair& pair : pairs) {
      if (pair.p != p && pair.q != p) continue;
      lists.other.push_back(pair.p + pair.q - p);
      lists.cues.push_back(pair.cues);
    }
    lists.first.push_back(static_cast<int32_t>(lists.other.size()));
  }
  for (int side = 0; side < 2; ++side) {
    for (int k = 0; k < kScales; ++k) {
      const auto count = std::count_if(pairs.begin(), pairs.end(), [&](const Pair& pair) {
        return (pair.cues >> (side * kDissimilarShift + k) & 1) != 0;
      });
      if (count > 0) lists.share[side * kScales + k] = 1.0f / (kScales * static_cast<float>(count));
    }
  }
  return lists;
}

struct Result {
  std::vector<float> grad;  // of the pixels, then the gate; less `start`
  double loss;
};
// Runs the op with gradients that hold `start` beforehand.
Result RunOp(Backend& backend, const Values& x, const std::vector<Pair>& pairs, float start) {
  const Lists lists = ListPairs(pairs);
  const Buffer<float> features = Upload(backend, {x.begin(), x.begin() + kPixels * kSize});
  const Buffer<float> gate = Upload(backend, {x.begin() + kPixels * kSize, x.end()});
  const Buffer<int32_t> first(backend, std::span<const int32_t>(lists.first)),
      other(backend, std::span<const int32_t>(lists.other));
  const Buffer<PairCues> cues(backend, std::span<const PairCues>(lists.cues));
  const Buffer<float> share(backend, std::span<const float>(lists.share));
  const Buffer<float> scales(backend, std::span<const float>(kQuantiles));
  Buffer<float> pixel_grad = Upload(backend, std::vector<float>(kPixels * kSize, start));
  Buffer<float> gate_grad = Upload(backend, std::vector<float>(gate.size(), start));
  Buffer<double> loss(backend, 1);
  backend.PerceptionLoss({.pixel_features = features.span(),
                          .first = first.span(),
                          .other = other.span(),
                          .cues = cues.span(),
                          .share = share.span(),
                          .scales = scales.span(),
                          .gate = gate.span(),
                          .weight = static_cast<float>(kWeight),
                          .pixel_grad = pixel_grad.span(),
                          .gate_grad = gate_grad.span(),
                          .loss = loss.span()});
  Result result = {Download(pixel_grad), Download(loss)[0]};
  const std::vector<float> of_gate = Download(gate_grad);
  result.grad.insert(result.grad.end(), of_gate.begin(), of_gate.end());
  for (float& g : result.grad) g -= start;
  return result;
}
Values Doubles(const std::vector<float>& values) { return {values.begin(), values.end()}; }

TEST_P(PerceptionLossTest, MatchesTheFormulaAndCentralDifferences) {
  const Values x = RandomInput();
  const std::vector<Pair> pairs = RandomPairs();
  ASSERT_GT(pairs.size(), 100u);
  const Result got = RunOp(*backend_, x, pairs, 0);
  EXPECT_NEAR(got.loss, Loss(x, pairs), 1e-6);
  const Values grad =
      CentralDifferences([&](const Values& v) { return kWeight * Loss(v, pairs); }, x);
  EXPECT_LT(RelativeError(Doubles(got.grad), grad), 1e-5);
}

TEST_P(PerceptionLossTest, MatchesCentralDifferencesWithAGateOfTwoLayers) {
  const Values x = RandomInput(kTwoLayerGateSize);
  const std::vector<Pair> pairs = RandomPairs();
  const Result got = RunOp(*backend_, x, pairs, 0);
  EXPECT_NEAR(got.loss, Loss(x, pairs), 1e-6);
  const Values grad =
      CentralDifferences([&](const Values& v) { return kWeight * Loss(v, pairs); }, x);
  EXPECT_LT(RelativeError(Doubles(got.grad), grad), 1e-5);
}

TEST_P(PerceptionLossTest, AddsToTheGradients) {
  const Values x = RandomInput();
  const Result alone = RunOp(*backend_, x, RandomPairs(), 0),
               added = RunOp(*backend_, x, RandomPairs(), 1);
  EXPECT_LT(RelativeError(Doubles(added.grad), Doubles(alone.grad)), 1e-3);  // few digits left
}

TEST_P(PerceptionLossTest, LeavesPixelsWithoutAPairAlone) {
  const Result got = RunOp(*backend_, RandomInput(), RandomPairs(), 0);
  for (int i = 0; i < kSize; ++i) {
    // Pixel 7 has no pair.
    EXPECT_EQ(got.grad[7 * kSize + i], 0);
    EXPECT_NE(got.grad[8 * kSize + i], 0);
  }
}

TEST_P(PerceptionLossTest, IsZeroWithoutPairs) {
  const Result got = RunOp(*backend_, RandomInput(), {}, 0);
  EXPECT_EQ(got.loss, 0);
  for (const float g : got.grad) ASSERT_EQ(g, 0);
}

TEST(PerceptionLoss, GivesTheSameBytesForAnyNumberOfThreads) {
  const auto run = [](int num_threads) {
    return RunOp(*MakeCpuBackend(num_threads), RandomInput(), RandomPairs(), 0);
  };
  const Result one = run(1);
  for (const int num_threads : {2, 3}) {
    const Result more = run(num_threads);
    EXPECT_EQ(one.grad, more.grad);
    EXPECT_EQ(one.loss, more.loss);
  }
}

}  // namespace
}  // namespace pepeseg
