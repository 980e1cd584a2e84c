#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "kernels/half.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/reference_renderer.h"
#include "tests/kernels/rendered.h"

// Captured rows against what Render blends, and feature maps against rows and a render in double.

namespace pepeseg {
namespace {

constexpr int kWidth = 53, kHeight = 39, kNumPixels = kWidth * kHeight;

// Results of CaptureRows.
struct Rows {
  Buffer<int32_t> first, gaussian;
  Buffer<float> weight;
  Buffer<float> alpha, depth;
};

class RowsTest : public BackendTest {
 protected:
  void Capture(Rendered& scene, const std::vector<int32_t>& pixels, Rows& rows) {
    const Buffer<int32_t> wanted(*backend_, std::span<const int32_t>(pixels));
    rows.alpha = Buffer<float>(*backend_, wanted.size());
    rows.depth = Buffer<float>(*backend_, wanted.size());
    CaptureRowsArgs args;
    args.pixels = wanted.span();
    args.scratch = &scene.scratch;
    args.row_first = &rows.first;
    args.entry_gaussian = &rows.gaussian;
    args.entry_weight = &rows.weight;
    args.pixel_alpha = rows.alpha.span();
    args.pixel_depth = rows.depth.span();
    backend_->CaptureRows(args);
  }
  Rendered Render() {
    Rendered scene(*backend_, RandomScene({.count = 400, .max_opacity_logit = 6}),
                   TestView(kWidth, kHeight));
    scene.Render();
    return scene;
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, RowsTest, AllBackends(), BackendName);

// All pixels in descending order, which is not that of the tiles.
std::vector<int32_t> EveryPixelBackwards() {
  std::vector<int32_t> pixels(kNumPixels);
  std::iota(pixels.rbegin(), pixels.rend(), 0);
  return pixels;
}

TEST_P(RowsTest, GiveTheColourOfTheRender) {
  Rendered scene = Render();
  const std::vector<int32_t> pixels = EveryPixelBackwards();
  Rows rows;
  Capture(scene, pixels, rows);
  const auto first = Download(rows.first), gaussian = Download(rows.gaussian);
  const auto weight = Download(rows.weight), alpha = Download(rows.alpha);
  const auto depth = Download(rows.depth), color = Download(scene.color);
  const auto rendered_alpha = Download(scene.alpha), rendered_depth = Download(scene.depth);
  // The red of each Gaussian as it was blended.
  std::vector<float> red(400);
  const auto visible = Download(scene.scratch.visible_gaussian);
  const auto splats = Download(scene.scratch.visible_splat);
  for (size_t v = 0; v < visible.size(); ++v) red[visible[v]] = splats[v].r;
  ASSERT_EQ(first.size(), pixels.size() + 1);
  ASSERT_GT(rows.weight.size(), kNumPixels);
  for (size_t i = 0; i < pixels.size(); ++i) {
    float sum = 0;
    for (int32_t k = first[i]; k < first[i + 1]; ++k) {
      ASSERT_GT(weight[k], 0);
      sum += weight[k] * red[gaussian[k]];
    }
    ASSERT_NEAR(sum, color[pixels[i]], 2e-6f) << i;
    ASSERT_NEAR(alpha[i], rendered_alpha[pixels[i]], 2e-6f) << i;
    ASSERT_NEAR(depth[i], rendered_depth[pixels[i]], 1e-5f) << i;
  }
}

TEST_P(RowsTest, GiveZAlsoAfterARenderOfInverseDepth) {
  Rendered scene = Render();
  const std::vector<int32_t> pixels = EveryPixelBackwards();
  Rows plain, inverse;
  Capture(scene, pixels, plain);
  scene.inverse_depth = true;
  scene.Render();
  Capture(scene, pixels, inverse);
  const auto want = Download(plain.depth), got = Download(inverse.depth);
  for (size_t i = 0; i < pixels.size(); ++i) ASSERT_NEAR(got[i], want[i], 1e-5f) << i;
}

TEST_P(RowsTest, AreEmptyForNoPixels) {
  Rendered scene = Render();
  Rows rows;
  Capture(scene, {}, rows);
  EXPECT_EQ(Download(rows.first), std::vector<int32_t>{0});
  EXPECT_EQ(rows.weight.size(), 0);
}

TEST_P(RowsTest, GiveTheRenderedFeatures) {
  Rendered scene = Render();
  const std::vector<int32_t> pixels = EveryPixelBackwards();
  Rows rows;
  Capture(scene, pixels, rows);
  const std::vector<float> features = RandomValues(400 * kFeatureSize, 3);
  const Buffer<float> features_in = Upload(*backend_, features);
  Buffer<Half> map(*backend_, kNumPixels * kFeatureSize);
  backend_->RenderFeatures({features_in.span(), &scene.scratch, map.span()});
  const auto first = Download(rows.first), gaussian = Download(rows.gaussian);
  const auto weight = Download(rows.weight);
  const std::vector<Half> got = Download(map);
  for (size_t i = 0; i < pixels.size(); ++i) {
    for (int c = 0; c < kFeatureSize; ++c) {
      float want = 0;
      for (int32_t k = first[i]; k < first[i + 1]; ++k) {
        want += weight[k] * features[gaussian[k] * kFeatureSize + c];
      }
      // Half precision has 11 bits.
      ASSERT_NEAR(FloatFromHalf(got[pixels[i] * kFeatureSize + c]), want,
                  1e-5f + std::abs(want) / 2048);
    }
  }
}

TEST_P(RowsTest, RedistributeTheWeightsByConfidence) {
  Rendered scene = Render();
  const std::vector<int32_t> pixels = EveryPixelBackwards();
  Rows rows;
  Capture(scene, pixels, rows);
  const std::vector<float> features = RandomValues(400 * kFeatureSize, 3);
  std::vector<float> confidence(400);
  for (size_t i = 0; i < confidence.size(); ++i)
    confidence[i] = 1.0f / static_cast<float>(1 + i % 9);
  const Buffer<float> features_in = Upload(*backend_, features);
  const Buffer<float> confidence_in = Upload(*backend_, confidence);
  Buffer<Half> map(*backend_, kNumPixels * kFeatureSize);
  backend_->RenderFeatures({features_in.span(), &scene.scratch, map.span(), confidence_in.span()});
  const auto first = Download(rows.first), gaussian = Download(rows.gaussian);
  const auto weight = Download(rows.weight);
  const std::vector<Half> got = Download(map);
  for (size_t i = 0; i < pixels.size(); ++i) {
    double sum = 0, confident = 0;
    std::vector<double> want(kFeatureSize);
    for (int32_t k = first[i]; k < first[i + 1]; ++k) {
      const double share = double{weight[k]} * double{confidence[gaussian[k]]};
      sum += double{weight[k]};
      confident += share;
      for (int c = 0; c < kFeatureSize; ++c) {
        want[c] += share * double{features[gaussian[k] * kFeatureSize + c]};
      }
    }
    for (int c = 0; c < kFeatureSize; ++c) {
      const double value = confident > 0 ? want[c] * sum / confident : 0;
      ASSERT_NEAR(double{FloatFromHalf(got[pixels[i] * kFeatureSize + c])}, value,
                  2e-5 + std::abs(value) / 1024)
          << i;
    }
  }
}

TEST_P(RowsTest, AreUnchangedByOneConfidenceForAll) {
  Rendered scene = Render();
  const Buffer<float> features = Upload(*backend_, RandomValues(400 * kFeatureSize, 3));
  const Buffer<float> confidence = Upload(*backend_, std::vector<float>(400, 0.25f));
  Buffer<Half> without(*backend_, kNumPixels * kFeatureSize), with(*backend_, without.size());
  backend_->RenderFeatures({features.span(), &scene.scratch, without.span()});
  backend_->RenderFeatures({features.span(), &scene.scratch, with.span(), confidence.span()});
  const std::vector<Half> want = Download(without), got = Download(with);
  for (size_t i = 0; i < want.size(); ++i) {
    ASSERT_NEAR(FloatFromHalf(got[i]), FloatFromHalf(want[i]),
                1e-6f + std::abs(FloatFromHalf(want[i])) / 1024);
  }
}

// Returns the feature map [H * W, 32] in double: the reference renderer blends three channels at a
// time as colours, over black. Also sets close_call, see ReferenceImage. Features must not be
// negative.
std::vector<double> DenseFeatures(const Rendered& scene, const std::vector<float>& features,
                                  std::vector<uint8_t>& close_call) {
  const double of_degree_0 = 0.5 / std::sqrt(std::acos(-1.0));
  const int64_t count = scene.host.count;
  ReferenceScene reference = {
      count, scene.host.sh_degree, {scene.host.planes.begin(), scene.host.planes.end()}};
  std::vector<double> dense(size_t{kNumPixels} * kFeatureSize);
  for (int from = 0; from < kFeatureSize; from += 3) {
    const int num_channels = std::min(3, kFeatureSize - from);
    for (int64_t i = 0; i < count; ++i) {
      for (int c = 0; c < num_channels; ++c) {
        const double feature = features[i * kFeatureSize + from + c];
        // Colour is 0.5 + coefficient * basis.
        reference.planes[(kShPlane + c) * count + i] = (feature - 0.5) / of_degree_0;
      }
    }
    ReferenceOptions options;
    options.near_plane = scene.near_plane;
    const ReferenceImage image = RenderReference(reference, scene.view, options);
    for (int c = 0; c < num_channels; ++c) {
      for (int p = 0; p < kNumPixels; ++p) {
        dense[p * kFeatureSize + from + c] = image.color[c * kNumPixels + p];
      }
    }
    close_call = image.close_call;
  }
  return dense;
}

TEST_P(RowsTest, GiveTheFeaturesOfADenseRenderInDouble) {
  Rendered scene(*backend_, RandomScene({.count = 400, .sh_degree = 0, .max_opacity_logit = 6}),
                 TestView(kWidth, kHeight));
  scene.Render();
  std::vector<float> features = RandomValues(400 * kFeatureSize, 3);
  for (float& value : features) value = 1 + 0.5f * value;  // the reference clamps colours at 0
  const std::vector<int32_t> pixels = EveryPixelBackwards();
  Rows rows;
  Capture(scene, pixels, rows);
  const Buffer<float> features_in = Upload(*backend_, features);
  Buffer<float> sparse(*backend_, kNumPixels * kFeatureSize);
  const RowSpan span = {rows.first.span(), rows.gaussian.span(), rows.weight.span()};
  backend_->FeatureRows({span, features_in.span(), sparse.span()});
  const std::vector<float> got = Download(sparse);
  std::vector<uint8_t> close_call;
  const std::vector<double> want = DenseFeatures(scene, features, close_call);
  int num_compared = 0;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const int32_t p = pixels[i];
    if (close_call[p] != 0) continue;
    if (want[p * kFeatureSize] > 0) ++num_compared;
    for (int c = 0; c < kFeatureSize; ++c) {
      const double dense = want[p * kFeatureSize + c];
      ASSERT_NEAR(got[i * kFeatureSize + c], dense, 1e-5 * dense) << p << ", " << c;
    }
  }
  EXPECT_GT(num_compared, 0.9 * kNumPixels);
}

}  // namespace
}  // namespace pepeseg
