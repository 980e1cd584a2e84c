#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "kernels/math/feature.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/central_differences.h"
#include "tests/kernels/sparse_rows.h"

// Smoothing over neighbours and its gradient against the formula in double.

namespace pepeseg {
namespace {

using Values = std::vector<double>;
constexpr int kSize = kFeatureSize, kGaussians = 120, kNeighbors = 6;
constexpr uint32_t kDrawn = 0b101101;  // columns 0, 2, 3 and 5

class SmoothTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, SmoothTest, AllBackends(), BackendName);

// Each Gaussian itself, then others at random: the op accepts any graph.
std::vector<int32_t> RandomGraph() {
  std::mt19937_64 engine(3);
  std::vector<int32_t> neighbors;
  for (int i = 0; i < kGaussians; ++i) {
    neighbors.push_back(i);
    for (int k = 1; k < kNeighbors; ++k)
      neighbors.push_back(static_cast<int>(engine() % kGaussians));
  }
  return neighbors;
}

// The formula of kernels/ops/smooth.h in double.
Values Smooth(const Values& features, const std::vector<int32_t>& graph, uint32_t drawn) {
  Values smoothed(features.size());
  for (int i = 0; i < kGaussians; ++i) {
    double* sum = smoothed.data() + i * kSize;
    for (int k = 0; k < kNeighbors; ++k) {
      if ((drawn >> k & 1u) == 0) continue;
      const double* f = features.data() + graph[i * kNeighbors + k] * kSize;
      const double length = std::sqrt(std::inner_product(f, f + kSize, f, 1e-12));
      for (int c = 0; c < kSize; ++c) sum[c] += f[c] / length;
    }
    const double length = std::sqrt(std::inner_product(sum, sum + kSize, sum, 1e-12));
    for (int c = 0; c < kSize; ++c) sum[c] /= length;
  }
  return smoothed;
}

// A graph and features on a backend, with room for the result.
struct Smoothing {
  Smoothing(Backend& backend, const std::vector<float>& start)
      : neighbors(backend, std::span<const int32_t>(RandomGraph())),
        features(Upload(backend, start)),
        smoothed(backend, kGaussians * kSize),
        inv_length(backend, kGaussians) {}
  NeighborGraph graph() const { return {neighbors.span(), kNeighbors}; }
  void Run(Backend& backend, DeviceSpan<const int32_t> gaussian) {
    backend.SmoothFeatures({.graph = graph(),
                            .drawn = kDrawn,
                            .gaussian = gaussian,
                            .features = features.span(),
                            .smoothed = smoothed.span(),
                            .inv_length = inv_length.span()});
  }

  Buffer<int32_t> neighbors;
  Buffer<float> features, smoothed, inv_length;
};

TEST_P(SmoothTest, IsTheMeanDirectionOfTheDrawnNeighbors) {
  const std::vector<float> start = RandomValues(kGaussians * kSize, 5);
  Smoothing smoothing(*backend_, start);
  smoothing.Run(*backend_, {});
  const Values want = Smooth({start.begin(), start.end()}, RandomGraph(), kDrawn);
  const std::vector<float> got = Download(smoothing.smoothed);
  EXPECT_LT(RelativeError({got.begin(), got.end()}, want), 1e-6);
}

TEST_P(SmoothTest, WritesOnlyTheRowsAskedFor) {
  Smoothing smoothing(*backend_, RandomValues(kGaussians * kSize, 5));
  const std::vector<int32_t> asked = {3, 50, 119};
  const Buffer<int32_t> gaussian(*backend_, std::span<const int32_t>(asked));
  smoothing.Run(*backend_, gaussian.span());
  const std::vector<float> got = Download(smoothing.inv_length);
  for (int i = 0; i < kGaussians; ++i) {
    EXPECT_EQ(got[i] > 0, std::find(asked.begin(), asked.end(), i) != asked.end()) << i;
  }
}

TEST_P(SmoothTest, SmoothsZerosToZeros) {
  Smoothing smoothing(*backend_, std::vector<float>(kGaussians * kSize));
  smoothing.Run(*backend_, {});
  for (const float value : Download(smoothing.smoothed)) ASSERT_EQ(value, 0);
}

TEST_P(SmoothTest, ListsNeighborsByTheDrawOfTheirGroup) {
  Smoothing smoothing(*backend_, std::vector<float>(kGaussians * kSize));
  // Three groups, of which the second is empty; a Gaussian may be in several.
  const std::vector<int32_t> gaussians = {0, 7, 9, 2, 7}, group_first = {0, 3, 3, 5};
  const std::vector<uint32_t> drawn = {0b11, 0b110, 0b100001};
  const Buffer<int32_t> gaussian(*backend_, std::span<const int32_t>(gaussians));
  Buffer<int32_t> row_first, row_gaussian;
  backend_->NeighborRows({.graph = smoothing.graph(),
                          .gaussian = gaussian.span(),
                          .group_first = group_first,
                          .drawn = drawn,
                          .row_first = &row_first,
                          .row_gaussian = &row_gaussian});
  const std::vector<int32_t> graph = RandomGraph();
  std::vector<int32_t> want;
  for (const int i : {0, 7, 9}) want.insert(want.end(), {graph[i * 6], graph[i * 6 + 1]});
  for (const int i : {2, 7}) want.insert(want.end(), {graph[i * 6], graph[i * 6 + 5]});
  EXPECT_EQ(Download(row_first), (std::vector<int32_t>{0, 2, 4, 6, 8, 10}));
  EXPECT_EQ(Download(row_gaussian), want);
}

TEST_P(SmoothTest, TransposesEachGroupOfRowsByItself) {
  const PinholeView view = TestView(40, 30);
  Rendered scene(*backend_, RandomScene({.count = kGaussians}), view);
  const SparseRows rows(*backend_, scene, EveryPixel(view, 11));
  const std::vector<int32_t> groups = {0, 40, 40, 90, static_cast<int32_t>(rows.first.size() - 1)};
  Buffer<int32_t> gaussian, first, pixel;
  Buffer<float> weight;
  std::vector<int32_t> group_column;
  backend_->TransposeRows({.rows = rows.span(),
                           .group_first = groups,
                           .num_gaussians = kGaussians,
                           .gaussian = &gaussian,
                           .first = &first,
                           .pixel = &pixel,
                           .weight = &weight,
                           .group_column = &group_column});
  ASSERT_EQ(group_column.size(), groups.size());
  EXPECT_EQ(group_column.back(), gaussian.size());
  const auto all_first = Download(first), all_gaussian = Download(gaussian);
  const auto all_pixel = Download(pixel);
  const auto all_weight = Download(weight);
  // Each group must equal the transpose of its rows alone, up to where its arrays start.
  for (size_t g = 0; g + 1 < groups.size(); ++g) {
    SCOPED_TRACE(g);
    RowSpan part = rows.span();
    part.first = part.first.Subspan(groups[g], groups[g + 1] - groups[g] + 1);
    const SparseColumns want(*backend_, part, kGaussians);
    const auto want_gaussian = Download(want.gaussian), want_first = Download(want.first);
    ASSERT_EQ(group_column[g + 1] - group_column[g], want.gaussian.size());
    const int32_t begin = all_first[group_column[g]];
    for (size_t i = 0; i < want_gaussian.size(); ++i) {
      EXPECT_EQ(all_gaussian[group_column[g] + i], want_gaussian[i]);
      EXPECT_EQ(all_first[group_column[g] + i] - begin, want_first[i]);
    }
    const auto want_pixel = Download(want.pixel);
    const auto want_weight = Download(want.weight);
    for (size_t e = 0; e < want_pixel.size(); ++e) {
      ASSERT_EQ(all_pixel[begin + e], want_pixel[e]);
      ASSERT_EQ(all_weight[begin + e], want_weight[e]);
    }
  }
}

// Returns the gradient of sum_p <grad_p, F(p)> with respect to the features, taken from the first
// moment of Adam after one step.
std::vector<float> FeatureGradient(Backend& backend, const SparseRows& rows,
                                   const std::vector<float>& start,
                                   const std::vector<float>& pixel_grad) {
  Smoothing smoothing(backend, start);
  const SparseColumns columns(backend, rows.span(), kGaussians);
  const std::vector<int32_t> one_group = {0, static_cast<int32_t>(columns.gaussian.size())};
  const uint32_t drawn[] = {kDrawn};
  Buffer<int32_t> row_first, row_gaussian, gaussian, first, pixel;
  backend.NeighborRows({.graph = smoothing.graph(),
                        .gaussian = columns.gaussian.span(),
                        .group_first = one_group,
                        .drawn = drawn,
                        .row_first = &row_first,
                        .row_gaussian = &row_gaussian});
  backend.TransposeRows({.rows = {row_first.span(), row_gaussian.span(), {}},
                         .group_first = {},
                         .num_gaussians = kGaussians,
                         .gaussian = &gaussian,
                         .first = &first,
                         .pixel = &pixel});
  smoothing.Run(backend, columns.gaussian.span());
  const Buffer<float> pixel_grad_in = Upload(backend, pixel_grad);
  Buffer<float> sum_grad(backend, columns.gaussian.size() * kSize);
  backend.SmoothBackward({columns.span(), pixel_grad_in.span(), smoothing.smoothed.span(),
                          smoothing.inv_length.span(), sum_grad.span()});
  Buffer<float> moment1(backend, kGaussians * kSize), moment2(backend, kGaussians * kSize);
  Buffer<int32_t> last_step(backend, kGaussians);
  Buffer<float> gate(backend, kGateSize), gate1(backend, kGateSize), gate2(backend, kGateSize);
  const Buffer<float> gate_grad(backend, kGateSize), correction = Upload(backend, {1, 1});
  FeatureRates rates;
  rates.correction = correction.span();
  backend.FeatureUpdate(
      {.columns = {gaussian.span(), first.span(), pixel.span(), {}},
       .pixel_grad = sum_grad.span(),
       .of_direction = true,
       .gate_grad = gate_grad.span(),
       .rates = rates,
       .norm_weight = 0,
       .state = {smoothing.features.span(), moment1.span(), moment2.span(), last_step.span()},
       .gate = gate.span(),
       .gate_moment1 = gate1.span(),
       .gate_moment2 = gate2.span()});
  // The first moment is (1 - beta1) times the gradient.
  std::vector<float> grad = Download(moment1);
  for (float& g : grad) g /= 1 - 0.9f;
  return grad;
}

TEST_P(SmoothTest, PassesGradientsBackThroughRowsAndNeighbors) {
  const PinholeView view = TestView(40, 30);
  Rendered scene(*backend_, RandomScene({.count = kGaussians}), view);
  const SparseRows rows(*backend_, scene, EveryPixel(view, 37));
  const auto first = Download(rows.first), gaussian = Download(rows.gaussian);
  const auto weight = Download(rows.weight);
  const auto num_pixels = static_cast<int64_t>(first.size()) - 1;
  const std::vector<float> start = RandomValues(kGaussians * kSize, 5);
  const std::vector<float> pixel_grad = RandomValues(num_pixels * kSize, 6);
  const std::vector<int32_t> graph = RandomGraph();
  const auto loss = [&](const Values& features) {
    const Values smoothed = Smooth(features, graph, kDrawn);
    double sum = 0;
    for (int64_t p = 0; p < num_pixels; ++p) {
      for (int32_t e = first[p]; e < first[p + 1]; ++e) {
        const double* f = smoothed.data() + gaussian[e] * kSize;
        sum += weight[e] * std::inner_product(f, f + kSize, pixel_grad.begin() + p * kSize, 0.0);
      }
    }
    return sum;
  };
  const std::vector<float> got = FeatureGradient(*backend_, rows, start, pixel_grad);
  EXPECT_LT(RelativeError({got.begin(), got.end()},
                          CentralDifferences(loss, {start.begin(), start.end()})),
            1e-5);
}

TEST(DirectionVjp, MatchesCentralDifferences) {
  Values x(kSize), w(kSize), direction(kSize);
  for (int k = 0; k < kSize; ++k) {
    x[k] = std::sin(3.0 * k);
    w[k] = std::cos(5.0 * k);
  }
  const auto f = [&](const Values& v) {
    Values unit(kSize);
    Direction(v.data(), kSize, unit.data());
    return std::inner_product(unit.begin(), unit.end(), w.begin(), 0.0);
  };
  const double inv_length = Direction(x.data(), kSize, direction.data());
  Values got = w;
  DirectionVjp(direction.data(), inv_length, kSize, got.data());
  EXPECT_LT(RelativeError(got, CentralDifferences(f, x)), 1e-6);
}

}  // namespace
}  // namespace pepeseg
