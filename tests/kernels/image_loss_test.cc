#include <gtest/gtest.h>

#include <random>

#include "kernels/math/ssim.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/central_differences.h"
#include "tests/kernels/image_loss_reference.h"

// ImageLoss against its definition, one window at a time, in double.

namespace pepeseg {
namespace {

using Values = std::vector<double>;

struct LossCase {
  int width, height;
  bool with_ignore;
};

// A random photograph, and an image that differs from it by noise. The upper right quarter may be
// ignored.
LossImages RandomImages(const LossCase& c, uint64_t seed) {
  LossImages images = {c.width, c.height, {}, {}, {}};
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> noise(-0.15, 0.15);
  const int num_pixels = c.width * c.height;
  for (int i = 0; i < 3 * num_pixels; ++i) {
    images.target.push_back(static_cast<uint8_t>(engine() % 256));
  }
  for (int i = 0; i < 3 * num_pixels; ++i) {
    const double target = images.target[i % num_pixels * 3 + i / num_pixels] / 255.0;
    images.color.push_back(static_cast<float>(target + noise(engine)));
  }
  if (!c.with_ignore) return images;
  for (int i = 0; i < num_pixels; ++i) {
    const bool inside = i % c.width > c.width / 2 && i / c.width < c.height / 2;
    images.ignore.push_back(inside ? 255 : 0);
  }
  return images;
}

struct OpLoss {
  std::vector<double> sums = std::vector<double>(kNumImageLossSums);
  std::vector<float> grad;
};

OpLoss RunOp(Backend& backend, const LossImages& images, bool want_grad = true,
             MemoryPlace place = MemoryPlace::kDevice) {
  const std::vector<float> color(images.color.begin(), images.color.end());
  Buffer<float> color_buffer(backend, std::span<const float>(color));
  Buffer<uint8_t> target(backend, static_cast<int64_t>(images.target.size()), place);
  Buffer<uint8_t> ignore(backend, static_cast<int64_t>(images.ignore.size()), place);
  target.Upload(images.target);
  ignore.Upload(images.ignore);
  Buffer<float> grad(backend, want_grad ? static_cast<int64_t>(color.size()) : 0);
  Buffer<double> sums(backend, kNumImageLossSums);
  ImageLossArgs args;
  args.width = images.width;
  args.height = images.height;
  args.color = color_buffer.span();
  args.target = target.span();
  args.ignore = ignore.span();
  args.color_grad = grad.span();
  args.sums = sums.span();
  backend.ImageLoss(args);
  OpLoss out;
  sums.Download(out.sums);
  out.grad.resize(grad.size());
  grad.Download(std::span<float>(out.grad));
  return out;
}

// Sizes below, at and above those of vectors, windows and bands.
constexpr LossCase kCases[] = {{70, 61, false}, {70, 61, true}, {16, 48, false}, {33, 49, true},
                               {5, 3, false},   {1, 1, false},  {17, 100, true}, {100, 12, false}};

class ImageLossTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, ImageLossTest, AllBackends(), BackendName);

TEST_P(ImageLossTest, ReadsPhotographsOnTheHost) {
  const LossImages images = RandomImages({70, 61, true}, 3);
  const OpLoss on_device = RunOp(*backend_, images);
  const OpLoss on_host = RunOp(*backend_, images, true, MemoryPlace::kHost);
  EXPECT_EQ(on_host.sums, on_device.sums);
  EXPECT_EQ(on_host.grad, on_device.grad);
  EXPECT_EQ(backend_->error(), "");
}

TEST_P(ImageLossTest, MatchesDoubleReference) {
  for (const LossCase& c : kCases) {
    const LossImages images = RandomImages(c, 7);
    const ReferenceLoss want = ComputeReferenceLoss(images);
    const OpLoss got = RunOp(*backend_, images);
    ASSERT_EQ(got.sums[kSumPixelChannels], want.num_pixel_channels);
    EXPECT_NEAR(got.sums[kSumL1] / want.num_pixel_channels, want.l1, 1e-7);
    EXPECT_NEAR(got.sums[kSumSquared] / want.num_pixel_channels, want.mse, 1e-7);
    EXPECT_NEAR(got.sums[kSumSsim] / want.num_pixel_channels, want.ssim, 1e-6);
    const Values want_grad = ComputeReferenceLossGradient(images, 0.2);
    EXPECT_LT(RelativeError(Values(got.grad.begin(), got.grad.end()), want_grad), 1e-5)
        << c.width << "x" << c.height;
  }
}

TEST_P(ImageLossTest, KeepsIgnoredPixelsFromAffectingOthers) {
  LossImages images = RandomImages({40, 60, true}, 3);
  const OpLoss before = RunOp(*backend_, images);
  for (size_t i = 0; i < images.color.size(); ++i) {
    if (images.ignore[i % images.ignore.size()] == 0) continue;
    EXPECT_EQ(before.grad[i], 0);
    images.color[i] = 5;  // would change every window that it counted in
  }
  const OpLoss after = RunOp(*backend_, images);
  EXPECT_EQ(before.sums, after.sums);
  EXPECT_EQ(before.grad, after.grad);
}

TEST_P(ImageLossTest, IsZeroIfEverythingIsIgnored) {
  LossImages images = RandomImages({20, 20, true}, 3);
  images.ignore.assign(400, 1);
  const OpLoss got = RunOp(*backend_, images);
  EXPECT_EQ(got.sums, std::vector<double>(kNumImageLossSums));
  EXPECT_EQ(got.grad, std::vector<float>(1200));
}

TEST_P(ImageLossTest, GivesEqualImagesAnSsimOfOne) {
  LossImages images = RandomImages({30, 30, false}, 3);
  for (int i = 0; i < 2700; ++i) images.color[i] = images.target[i % 900 * 3 + i / 900] / 255.0;
  const OpLoss got = RunOp(*backend_, images);
  EXPECT_NEAR(got.sums[kSumSsim] / 2700, 1, 1e-6);
  EXPECT_NEAR(got.sums[kSumL1] / 2700, 0, 1e-7);
}

TEST_P(ImageLossTest, GivesTheSameSumsWithoutGradient) {
  const LossImages images = RandomImages({70, 61, true}, 5);
  EXPECT_EQ(RunOp(*backend_, images, false).sums, RunOp(*backend_, images, true).sums);
}

TEST(ImageLoss, GivesTheSameBytesForAnyNumberOfThreads) {
  const LossImages images = RandomImages({130, 150, true}, 9);
  const OpLoss one = RunOp(*MakeCpuBackend(1), images);
  for (int threads : {2, 3}) {
    const OpLoss other = RunOp(*MakeCpuBackend(threads), images);
    EXPECT_EQ(one.sums, other.sums);
    EXPECT_EQ(one.grad, other.grad);
  }
}

TEST(SsimVjp, MatchesCentralDifferences) {
  for (const bool with_ignore : {false, true}) {
    const LossImages images = RandomImages({8, 7, with_ignore}, 11);
    const auto f = [&](const Values& color) {
      LossImages moved = images;
      moved.color = color;
      // SSIM alone, as L1 has corners.
      return 1 - ComputeReferenceLoss(moved).ssim;
    };
    const Values want = CentralDifferences(f, images.color, 1e-3);
    EXPECT_LT(RelativeError(ComputeReferenceLossGradient(images, 1.0), want), 1e-6);
  }
}

TEST(SsimTaps, AreANormalisedGaussian) {
  double sum = kSsimTaps[0];
  for (int k = 1; k <= kSsimRadius; ++k) {
    sum += 2 * kSsimTaps[k];
    EXPECT_NEAR(kSsimTaps[k] / kSsimTaps[0], std::exp(-k * k / 4.5), 1e-12);
  }
  EXPECT_NEAR(sum, 1, 1e-12);
}

}  // namespace
}  // namespace pepeseg
