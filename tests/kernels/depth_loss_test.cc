#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "kernels/math/blend.h"
#include "kernels/math/depth.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/central_differences.h"
#include "tests/kernels/depth_reference.h"
#include "tests/kernels/test_scene.h"

// DepthLoss against the reference, and the formulas of kernels/math/depth.h against central
// differences.

namespace pepeseg {
namespace {

using Values = std::vector<double>;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

struct Size {
  int width, height;
};

// Images whose prior is the depth up to scale, shift and a slowly varying error, with unknown
// pixels, outliers, faint pixels and an ignored corner.
DepthImages RandomImages(Size size, uint64_t seed) {
  DepthImages images;
  images.width = size.width;
  images.height = size.height;
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (int i = 0; i < size.width * size.height; ++i) {
    const int column = i % size.width, row = i / size.width;
    const auto x = static_cast<float>(column), y = static_cast<float>(row);
    const float depth = 2 + std::sin(0.13f * x) + 0.02f * y + 0.3f * uniform(engine);
    const float alpha = i % 11 == 0 ? 0.5f * uniform(engine) : 0.51f + 0.49f * uniform(engine);
    images.alpha.push_back(alpha);
    images.depth.push_back(alpha * depth);
    float prior = 0.2f * depth - 0.1f + 0.05f * std::cos(0.05f * x + 0.07f * y);
    if (i % 13 == 5) prior = kNan;
    if (i % 29 == 7) prior = 2 * uniform(engine) - 0.5f;
    images.prior.push_back(prior);
    images.ignore.push_back(x < 4 && y < 3 ? 255 : 0);
  }
  images.options.min_prior = 0.05f;
  images.options.max_prior = 0.95f;
  images.options.view_weight = 0.1f;
  images.options.local_weight = 0.25f;
  return images;
}

// Images compared in windows of this radius, and in one rectangle.
DepthImages WithWindows(Size size, int radius) {
  DepthImages images = RandomImages(size, 5);
  images.options.window_radius = radius;
  return images;
}

DepthImages WithPatch(Size size, const PixelBox& patch) {
  DepthImages images = RandomImages(size, 5);
  images.options.local_form = DepthLocalForm::kPatch;
  images.options.patch = patch;
  return images;
}

// Results of the op.
struct OpLoss {
  Values sums = Values(kNumDepthLossSums);
  std::vector<float> alpha_grad, depth_grad;
};

OpLoss RunOp(Backend& backend, const DepthImages& images) {
  const Buffer<float> alpha = Upload(backend, images.alpha), depth = Upload(backend, images.depth);
  const Buffer<float> prior = Upload(backend, images.prior);
  const Buffer<uint8_t> ignore(backend, std::span<const uint8_t>(images.ignore));
  // The op must overwrite what the gradients held before.
  Buffer<float> alpha_grad = Upload(backend, std::vector<float>(images.alpha.size(), 7));
  Buffer<float> depth_grad = Upload(backend, std::vector<float>(images.alpha.size(), 7));
  Buffer<double> sums(backend, kNumDepthLossSums);
  DepthLossArgs args = images.options;
  args.width = images.width;
  args.height = images.height;
  args.alpha = alpha.span();
  args.depth = depth.span();
  args.prior = prior.span();
  args.ignore = ignore.span();
  args.alpha_grad = alpha_grad.span();
  args.depth_grad = depth_grad.span();
  args.sums = sums.span();
  backend.DepthLoss(args);
  OpLoss out;
  sums.Download(out.sums);
  out.alpha_grad = Download(alpha_grad);
  out.depth_grad = Download(depth_grad);
  return out;
}

// Compares gradients, except at pixels where rounding decides the sign of a residual.
void ExpectGradient(const std::vector<float>& got, const Values& want,
                    const std::vector<uint8_t>& close_call) {
  Values far_got, far_want;
  for (size_t i = 0; i < want.size(); ++i) {
    ASSERT_TRUE(std::isfinite(got[i])) << i;
    if (close_call[i] != 0) continue;
    far_got.push_back(got[i]);
    far_want.push_back(want[i]);
  }
  EXPECT_GT(far_got.size(), 0.99 * static_cast<double>(got.size()));
  EXPECT_LT(RelativeError(far_got, far_want), 2e-5);
}

// Compares sums and gradients with the reference.
void ExpectMatchesReference(Backend& backend, const DepthImages& images) {
  SCOPED_TRACE(testing::Message() << images.width << "x" << images.height << " radius "
                                  << images.options.window_radius);
  const ReferenceDepthLoss want = ComputeReferenceDepthLoss(images);
  const OpLoss got = RunOp(backend, images);
  EXPECT_EQ(got.sums[kDepthSkipped], want.skipped ? 1 : 0);
  EXPECT_EQ(got.sums[kSumDepthPixels], want.num_pixels);
  EXPECT_NEAR(got.sums[kSumDepthView], want.view, 1e-6 * want.view);
  EXPECT_NEAR(got.sums[kSumDepthLocal], want.local, 1e-5 * want.local);
  ExpectGradient(got.depth_grad, want.depth_grad, want.close_call);
  ExpectGradient(got.alpha_grad, want.alpha_grad, want.close_call);
}

class DepthLossTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, DepthLossTest, AllBackends(), BackendName);

TEST_P(DepthLossTest, MatchesReferenceInWindows) {
  ExpectMatchesReference(*backend_, WithWindows({70, 61}, 3));
  ExpectMatchesReference(*backend_, WithWindows({131, 40}, 7));
  ExpectMatchesReference(*backend_, WithWindows({300, 33}, 2));
  ExpectMatchesReference(*backend_, WithWindows({33, 17}, 40));  // wider than the image
  ExpectMatchesReference(*backend_, WithWindows({20, 16}, 1));
}

TEST_P(DepthLossTest, MatchesReferenceInARectangle) {
  ExpectMatchesReference(*backend_, WithPatch({70, 61}, {10, 20, 25, 14}));
  ExpectMatchesReference(*backend_, WithPatch({131, 90}, {0, 0, 131, 90}));
  ExpectMatchesReference(*backend_, WithPatch({131, 90}, {127, 30, 4, 60}));
}

TEST_P(DepthLossTest, ComparesTheViewAloneIfTheRectangleCarriesNoFit) {
  // 16 pixels, below the 32 that a fit takes.
  const DepthImages images = WithPatch({70, 61}, {10, 20, 4, 4});
  const OpLoss got = RunOp(*backend_, images);
  EXPECT_EQ(got.sums[kDepthSkipped], 0);
  EXPECT_EQ(got.sums[kSumDepthLocal], 0);
  EXPECT_GT(got.sums[kSumDepthView], 0);
  ExpectMatchesReference(*backend_, images);
}

TEST_P(DepthLossTest, FindsScaleAndShift) {
  // A prior that is exactly linear in the depth.
  DepthImages images = WithWindows({40, 30}, 3);
  for (size_t i = 0; i < images.prior.size(); ++i) {
    images.prior[i] = 0.25f * images.depth[i] / images.alpha[i] - 0.3f;
  }
  const OpLoss got = RunOp(*backend_, images);
  EXPECT_NEAR(got.sums[kDepthScale], 0.25, 1e-5);
  EXPECT_NEAR(got.sums[kDepthShift], -0.3, 1e-5);
  EXPECT_NEAR(got.sums[kSumDepthView], 0, 1e-7);
}

// Expects that the view is skipped: no gradient and no sum but kDepthSkipped.
void ExpectSkipped(Backend& backend, const DepthImages& images) {
  const OpLoss got = RunOp(backend, images);
  for (int k = 0; k < kNumDepthLossSums; ++k) {
    EXPECT_EQ(got.sums[k], k == kDepthSkipped ? 1 : 0) << k;
  }
  EXPECT_EQ(got.depth_grad, std::vector<float>(images.alpha.size()));
  EXPECT_EQ(got.alpha_grad, std::vector<float>(images.alpha.size()));
}

TEST_P(DepthLossTest, SkipsAViewWithoutAFit) {
  // No spread of depth, a prior that falls where depth rises, an unknown prior, no depth at all,
  // and too few pixels.
  DepthImages flat = WithWindows({40, 30}, 3);
  for (size_t i = 0; i < flat.depth.size(); ++i) flat.depth[i] = 2 * flat.alpha[i];
  ExpectSkipped(*backend_, flat);
  DepthImages wrong_sign = WithPatch({40, 30}, {0, 0, 40, 30});
  for (float& prior : wrong_sign.prior) prior = 1 - prior;
  ExpectSkipped(*backend_, wrong_sign);
  DepthImages unknown = WithWindows({40, 30}, 3);
  unknown.prior.assign(unknown.prior.size(), kNan);
  ExpectSkipped(*backend_, unknown);
  DepthImages nothing = WithWindows({40, 30}, 3);
  nothing.alpha.assign(nothing.alpha.size(), 0);
  nothing.depth.assign(nothing.depth.size(), 0);
  ExpectSkipped(*backend_, nothing);
  ExpectSkipped(*backend_, WithWindows({1, 1}, 3));
}

TEST_P(DepthLossTest, IgnoresPixelsThatDoNotCount) {
  DepthImages images = WithWindows({70, 61}, 3);
  const OpLoss before = RunOp(*backend_, images);
  for (size_t i = 0; i < images.prior.size(); ++i) {
    if (images.ignore[i] != 0) images.prior[i] = 0.4f;
    if (images.alpha[i] > 0.5f && images.ignore[i] == 0 && images.prior[i] < 0.95f &&
        images.prior[i] > 0.05f) {
      continue;
    }
    EXPECT_EQ(before.depth_grad[i], 0);
    EXPECT_EQ(before.alpha_grad[i], 0);
    images.depth[i] = 1e6f;  // would change every fit that it counted in
  }
  const OpLoss after = RunOp(*backend_, images);
  EXPECT_EQ(before.sums, after.sums);
  EXPECT_EQ(before.depth_grad, after.depth_grad);
}

TEST_P(DepthLossTest, GivesTheSameBytesEachTime) {
  const DepthImages images = WithWindows({131, 150}, 6);
  const OpLoss once = RunOp(*backend_, images), again = RunOp(*backend_, images);
  EXPECT_EQ(once.sums, again.sums);
  EXPECT_EQ(once.depth_grad, again.depth_grad);
  EXPECT_EQ(once.alpha_grad, again.alpha_grad);
}

TEST(DepthLoss, GivesTheSameBytesForAnyNumberOfThreads) {
  const DepthImages images = WithWindows({131, 150}, 6);
  const OpLoss one = RunOp(*MakeCpuBackend(1), images);
  for (const int threads : {2, 3}) {
    const OpLoss other = RunOp(*MakeCpuBackend(threads), images);
    EXPECT_EQ(one.sums, other.sums);
    EXPECT_EQ(one.depth_grad, other.depth_grad);
    EXPECT_EQ(one.alpha_grad, other.alpha_grad);
  }
}

// Moments of 50 points about a line.
DepthMoments<double> SomeMoments() {
  DepthMoments<double> m = {};
  for (int i = 0; i < 50; ++i) m = m + DepthMomentsOf(1 + 0.03 * i, 0.5 + 0.02 * i + 0.1 * (i % 3));
  return m;
}

TEST(FitScaleShift, IsTheMinimum) {
  const DepthMoments<double> m = SomeMoments();
  for (const double floor : {0.0, 0.05}) {
    const auto fit = FitScaleShift(m, floor);
    const auto error = [&](const Values& line) {
      double sum = floor * line[0] * line[0];
      for (int i = 0; i < 50; ++i) {
        const double d = 0.5 + 0.02 * i + 0.1 * (i % 3);
        const double r = DepthResidual<double>({line[0], line[1]}, 1 + 0.03 * i, d);
        sum += r * r / 50;
      }
      return sum;
    };
    // The error is least where both of its derivatives are 0.
    for (const double slope : CentralDifferences(error, {fit.scale, fit.shift})) {
      EXPECT_NEAR(slope, 0, 1e-10);
    }
  }
}

TEST(FitWindow, HasNoScaleWhereThePriorFalls) {
  DepthMoments<double> m = {};
  for (int i = 0; i < 10; ++i) m = m + DepthMomentsOf(1.0 + i, 1 - 0.1 * i);
  const auto fit = FitWindow(m, 0.0);
  EXPECT_EQ(fit.scale, 0);
  EXPECT_NEAR(fit.shift, 0.55, 1e-12);
  EXPECT_NEAR(FitScaleShift(m, 0.0).scale, -0.1, 1e-12);
}

TEST(DepthVjp, MatchesCentralDifferences) {
  const ScaleShift<double> fit = {0.7, -0.2};
  for (const double d : {0.3, 1.9}) {
    const auto error = [&](const Values& v) {
      return 3 * std::abs(DepthResidual(fit, NormalizedDepth(v[0], v[1]), d));
    };
    const Values at = {1.3, 0.8};
    const double x = NormalizedDepth(at[0], at[1]);
    const auto grad =
        NormalizedDepthVjp(x, at[1], AbsDepthResidualVjp(fit, DepthResidual(fit, x, d), 3.0));
    EXPECT_LT(RelativeError({grad.depth_sum, grad.alpha}, CentralDifferences(error, at)), 1e-6);
  }
}

TEST(InverseDepthVjp, MatchesCentralDifferences) {
  const auto f = [](const Values& z) { return 2.5 * InverseDepth(z[0]); };
  EXPECT_LT(RelativeError({InverseDepthVjp(InverseDepth(1.7), 2.5)}, CentralDifferences(f, {1.7})),
            1e-6);
}

}  // namespace
}  // namespace pepeseg
