#include "kernels/math/feature.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <tuple>

#include "kernels/half.h"
#include "kernels/math/adam.h"
#include "kernels/math/gate.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/central_differences.h"
#include "tests/kernels/sparse_rows.h"

// Rows, their transpose, and the update of features, against dense computations in double.

namespace pepeseg {
namespace {

using Values = std::vector<double>;
constexpr int kSize = kFeatureSize;

class FeaturesTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, FeaturesTest, AllBackends(), BackendName);

TEST_P(FeaturesTest, GivesTheDenseFeatureMapFromSparseRows) {
  const PinholeView view = TestView(70, 50);
  Rendered scene(*backend_, RandomScene({.count = 300}), view);
  const std::vector<int32_t> pixels = EveryPixel(view, 7);
  SparseRows rows(*backend_, scene, pixels);
  const Buffer<float> features = Upload(*backend_, RandomValues(300 * kSize, 3));
  Buffer<Half> map(*backend_, int64_t{70} * 50 * kSize);
  Buffer<float> got(*backend_, static_cast<int64_t>(pixels.size()) * kSize);
  RenderFeaturesArgs dense;
  dense.features = features.span();
  dense.scratch = &scene.scratch;
  dense.map = map.span();
  backend_->RenderFeatures(dense);
  FeatureRowsArgs sparse;
  sparse.rows = rows.span();
  sparse.features = features.span();
  sparse.pixel_features = got.span();
  backend_->FeatureRows(sparse);
  const std::vector<Half> want = Download(map);
  const std::vector<float> values = Download(got);
  for (size_t i = 0; i < pixels.size(); ++i) {
    for (int k = 0; k < kSize; ++k) {
      // The map is rounded to half precision, 11 bits.
      ASSERT_NEAR(values[i * kSize + k], FloatFromHalf(want[pixels[i] * kSize + k]), 1e-3);
    }
  }
}

TEST_P(FeaturesTest, KeepsTheEntriesOfRowsThatItTransposes) {
  const PinholeView view = TestView(40, 30);
  Rendered scene(*backend_, RandomScene({.count = 120}), view);
  SparseRows rows(*backend_, scene, EveryPixel(view, 11));
  SparseColumns columns(*backend_, rows.span(), 120);
  std::vector<std::tuple<int32_t, int32_t, float>> want, got;
  const auto first = Download(rows.first), gaussian = Download(rows.gaussian);
  const auto weight = Download(rows.weight);
  for (int32_t p = 0; p + 1 < static_cast<int32_t>(first.size()); ++p) {
    for (int32_t e = first[p]; e < first[p + 1]; ++e) want.emplace_back(gaussian[e], p, weight[e]);
  }
  std::sort(want.begin(), want.end());
  const auto touched = Download(columns.gaussian), begin = Download(columns.first);
  const auto pixel = Download(columns.pixel);
  const auto column_weight = Download(columns.weight);
  for (size_t i = 0; i < touched.size(); ++i) {
    EXPECT_LT(begin[i], begin[i + 1]);
    for (int32_t e = begin[i]; e < begin[i + 1]; ++e) {
      got.emplace_back(touched[i], pixel[e], column_weight[e]);
    }
  }
  // `got` must already be in order: ascending by Gaussian, then by pixel.
  EXPECT_FALSE(want.empty());
  EXPECT_EQ(got, want);
}

// Adam as in the paper, in double, on every row at every step.
struct DenseAdam {
  explicit DenseAdam(const std::vector<float>& start)
      : x(start.begin(), start.end()), m(start.size()), v(start.size()) {}
  void Step(const Values& grad, int t) {
    for (size_t i = 0; i < x.size(); ++i) {
      m[i] = beta1 * m[i] + (1 - beta1) * grad[i];
      v[i] = beta2 * v[i] + (1 - beta2) * grad[i] * grad[i];
      x[i] -= rate * (m[i] / (1 - std::pow(beta1, t))) /
              (std::sqrt(v[i] / (1 - std::pow(beta2, t))) + 1e-15);
    }
  }
  double beta1 = 0.9f, beta2 = 0.999f, rate = 2.5e-3f;
  Values x, m, v;
};

// State of a run of updates.
struct LazyRun {
  LazyRun(Backend& backend, int num_rows, int num_steps)
      : num_rows(num_rows),
        num_steps(num_steps),
        start(RandomValues(int64_t{num_rows} * kSize, 1)),
        features(Upload(backend, start)),
        moment1(backend, features.size()),
        moment2(backend, features.size()),
        gate(backend, kTwoLayerGateSize),
        gate1(backend, kTwoLayerGateSize),
        gate2(backend, kTwoLayerGateSize),
        last_step(backend, num_rows) {
    std::vector<float> terms(num_steps + 1);
    for (int t = 1; t <= num_steps; ++t) {
      terms[t] = static_cast<float>(std::sqrt(1 - std::pow(double{0.999f}, t)) /
                                    (1 - std::pow(double{0.9f}, t)));
    }
    correction = Upload(backend, terms);
    rates.correction = correction.span();
  }
  FeatureState State() {
    return {features.span(), moment1.span(), moment2.span(), last_step.span()};
  }

  int num_rows, num_steps;
  std::vector<float> start;
  Buffer<float> features, moment1, moment2, gate, gate1, gate2, correction;
  Buffer<int32_t> last_step;
  FeatureRates rates;
};

// Updates these rows. Each has one pixel of weight 1, so the gradient of the pixel is that of the
// row.
void LazyStep(Backend& backend, LazyRun& run, const std::vector<int32_t>& rows,
              const std::vector<float>& grad, int step) {
  const auto count = static_cast<int32_t>(rows.size());
  std::vector<int32_t> first, pixel;
  for (int32_t i = 0; i <= count; ++i) first.push_back(i);
  for (int32_t i = 0; i < count; ++i) pixel.push_back(i);
  const Buffer<int32_t> gaussian_buffer(backend, std::span<const int32_t>(rows));
  const Buffer<int32_t> first_buffer(backend, std::span<const int32_t>(first));
  const Buffer<int32_t> pixel_buffer(backend, std::span<const int32_t>(pixel));
  const Buffer<float> weight = Upload(backend, std::vector<float>(count, 1.0f));
  const Buffer<float> grad_buffer = Upload(backend, grad);
  const Buffer<float> gate_grad = Upload(backend, std::vector<float>(kTwoLayerGateSize, 0.5f));
  if (count > 0) {
    backend.FeatureCatchUp({gaussian_buffer.span(), run.rates, step - 1, run.State()});
  }
  FeatureUpdateArgs args;
  args.columns = {gaussian_buffer.span(), first_buffer.span(), pixel_buffer.span(), weight.span()};
  args.pixel_grad = grad_buffer.span();
  args.gate_grad = gate_grad.span();
  args.rates = run.rates;
  args.norm_weight = 0;
  args.step = step;
  args.state = run.State();
  args.gate = run.gate.span();
  args.gate_moment1 = run.gate1.span();
  args.gate_moment2 = run.gate2.span();
  backend.FeatureUpdate(args);
}

TEST_P(FeaturesTest, MatchesDenseAdamWithLazyAdam) {
  constexpr int kRows = 12, kSteps = 900;
  LazyRun run(*backend_, kRows, kSteps);
  DenseAdam dense(run.start);
  std::mt19937_64 engine(4);
  for (int step = 1; step <= kSteps; ++step) {
    std::vector<int32_t> rows;
    std::vector<float> grad;
    Values dense_grad(kRows * kSize);
    for (int row = 0; row < kRows; ++row) {
      // Row 0 is never touched, row 1 at every step, the others at random and ever less often: the
      // rarest wait longer than kMaxReplay steps.
      if (row == 0 || engine() % (row * row * row) != 0) continue;
      rows.push_back(row);
      for (int k = 0; k < kSize; ++k) {
        const auto g = static_cast<float>(1e-6 * (static_cast<double>(engine() % 2000) - 900));
        grad.push_back(g);
        dense_grad[row * kSize + k] = g;
      }
    }
    // The dense one moves rows without a gradient, too.
    dense.Step(dense_grad, step);
    LazyStep(*backend_, run, rows, grad, step);
  }
  backend_->FeatureCatchUp({{}, run.rates, kSteps, run.State()});
  const std::vector<float> got = Download(run.features);
  double moved = 0;
  for (int i = 0; i < kRows * kSize; ++i) {
    // Allows for 900 roundings of float. A wrong replay is off by whole steps of 2.5e-3.
    ASSERT_NEAR(got[i], dense.x[i], 2e-5) << "row " << i / kSize;
    moved = std::max(moved, std::abs(dense.x[i] - double{run.start[i]}));
  }
  EXPECT_GT(moved, 0.1);
  // The gradient of the gate is the same for all its numbers in all steps.
  const std::vector<float> gate = Download(run.gate);
  EXPECT_LT(gate[0], -0.1);
  for (const float g : gate) ASSERT_EQ(g, gate[0]);
}

TEST_P(FeaturesTest, GathersGradientsThroughTheRowsAndAddsTheNorm) {
  const PinholeView view = TestView(40, 30);
  Rendered scene(*backend_, RandomScene({.count = 120}), view);
  SparseRows rows(*backend_, scene, EveryPixel(view, 11));
  SparseColumns columns(*backend_, rows.span(), 120);
  const auto num_pixels = rows.first.size() - 1;
  LazyRun run(*backend_, 120, 1);
  const std::vector<float> pixel_grad = RandomValues(num_pixels * kSize, 9);
  const Buffer<float> grad_buffer = Upload(*backend_, pixel_grad);
  const Buffer<float> gate_grad(*backend_, kTwoLayerGateSize);
  FeatureUpdateArgs args;
  args.columns = columns.span();
  args.pixel_grad = grad_buffer.span();
  args.gate_grad = gate_grad.span();
  args.rates = run.rates;
  args.norm_weight = 2;
  args.state = run.State();
  args.gate = run.gate.span();
  args.gate_moment1 = run.gate1.span();
  args.gate_moment2 = run.gate2.span();
  backend_->FeatureUpdate(args);

  // The gradient of each feature by the transposed sum, and that of the norm.
  const auto first = Download(rows.first), gaussian = Download(rows.gaussian);
  const auto weight = Download(rows.weight);
  Values want(120 * kSize), got;
  for (int64_t p = 0; p < num_pixels; ++p) {
    for (int32_t e = first[p]; e < first[p + 1]; ++e) {
      for (int k = 0; k < kSize; ++k) {
        want[gaussian[e] * kSize + k] += double{weight[e]} * pixel_grad[p * kSize + k];
      }
    }
  }
  const auto touched = Download(columns.gaussian);
  for (const int32_t row : touched) {
    const Values f(run.start.begin() + row * kSize, run.start.begin() + (row + 1) * kSize);
    const double norm = std::sqrt(std::inner_product(f.begin(), f.end(), f.begin(), 1e-12));
    for (int k = 0; k < kSize; ++k) {
      want[row * kSize + k] += 2.0 / touched.size() * 2 * (norm - 1) * f[k] / norm;
    }
  }
  // After one step from 0 the first moment is a tenth of the gradient.
  for (const float m : Download(run.moment1)) got.push_back(m / (1 - double{0.9f}));
  EXPECT_LT(RelativeError(got, want), 1e-5);
}

TEST(GatedUnitVjp, MatchesCentralDifferences) {
  std::mt19937_64 engine(2);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Values x(2 * kSize), w(kSize);  // psi, then the feature
  for (double& value : x) value = uniform(engine);
  for (double& value : w) value = uniform(engine);
  const auto f = [&](const Values& v) {
    Values unit(kSize);
    GatedUnit(v.data(), v.data() + kSize, kSize, unit.data());
    return std::inner_product(unit.begin(), unit.end(), w.begin(), 0.0);
  };
  Values got(2 * kSize);
  GatedUnitVjp(x.data(), x.data() + kSize, kSize, w.data(), got.data() + kSize, got.data());
  EXPECT_LT(RelativeError(got, CentralDifferences(f, x)), 1e-6);
}

TEST(NormTermVjp, MatchesCentralDifferences) {
  Values x(kSize);
  for (int k = 0; k < kSize; ++k) x[k] = 0.1 * k - 1.2;
  const auto f = [&](const Values& v) { return 0.7 * NormTerm(v.data(), kSize); };
  Values got = x;
  for (double& g : got) g *= NormTermVjp(x.data(), kSize, 0.7);
  EXPECT_LT(RelativeError(got, CentralDifferences(f, x)), 1e-6);
}

TEST(GateVjp, MatchesCentralDifferences) {
  const auto f = [](const Values& v) { return 0.7 * Gate(v[0], v[1], 0.6); };
  const double bias_grad = GateVjp(Gate(0.4, -0.3, 0.6), 0.7);
  EXPECT_LT(RelativeError({0.6 * bias_grad, bias_grad}, CentralDifferences(f, {0.4, -0.3})), 1e-6);
}

TEST(GateAtVjp, MatchesCentralDifferencesWithEitherNumberOfLayers) {
  constexpr double kScale = 0.6;
  for (const int size : {kGateSize, kTwoLayerGateSize}) {
    const std::vector<float> values = RandomValues(size + kSize, 3);
    const Values gate(values.begin(), values.begin() + size), w(values.end() - kSize, values.end());
    const auto f = [&](const Values& v) {
      Values psi(kSize);
      GateAt(GateNumbers<double>{v.data(), size}, kSize, kScale, psi.data());
      return std::inner_product(psi.begin(), psi.end(), w.begin(), 0.0);
    };
    Values psi_grad = w, got(size);
    GateAtVjp(GateNumbers<double>{gate.data(), size}, kSize, kScale, psi_grad.data(), got.data());
    EXPECT_LT(RelativeError(got, CentralDifferences(f, gate)), 1e-6) << size;
  }
}

}  // namespace
}  // namespace pepeseg
