#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/math/adam.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/rendered.h"

// Update against Adam in double on the gradients that it computes, and what it does to single
// Gaussians. The gradients themselves are compared with a reference in render_backward_test.cc.

namespace pepeseg {
namespace {

class UpdateTest : public BackendTest {
 protected:
  // Returns a scene after a render and its backward pass, ready for Update.
  Rendered Stepped(const HostGaussians& scene) {
    Rendered out(*backend_, scene, TestView(60, 45));
    out.Render();
    out.Backward(RandomValues(3 * 60 * 45, 9));
    return out;
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, UpdateTest, AllBackends(), BackendName);

// Learning rate of a plane.
double RateOf(const LearningRates& rates, int plane) {
  const double by_group[] = {rates.mean, rates.log_scale, rates.rotation, rates.opacity,
                             rates.sh_dc};
  const int ends[] = {kLogScalePlane, kRotationPlane, kOpacityPlane, kShPlane, kShPlane + 3};
  for (int k = 0; k < 5; ++k) {
    if (plane < ends[k]) return by_group[k];
  }
  return rates.sh_rest;
}

TEST_P(UpdateTest, IsAdamOnTheGradients) {
  Rendered scene = Stepped(RandomScene({.count = 137}));
  const size_t size = scene.host.planes.size();
  std::vector<double> want(scene.host.planes.begin(), scene.host.planes.end());
  std::vector<double> moment1(size), moment2(size);
  for (int step = 1; step <= 3; ++step) {
    const std::vector<float> grad = scene.ParameterGradient();
    const UpdateArgs args = scene.MakeUpdateArgs();
    const double correction1 = 1 / (1 - std::pow(args.beta1, step));
    const double correction2 = 1 / std::sqrt(1 - std::pow(args.beta2, step));
    backend_->Update(args);
    const AdamRates<double> rates = {args.beta1, args.beta2, args.epsilon, correction1,
                                     correction2};
    for (size_t i = 0; i < size; ++i) {
      const double rate = RateOf(args.learning_rates, static_cast<int>(i / scene.host.count));
      want[i] += AdamStep<double>(rates, rate, grad[i], moment1[i], moment2[i]);
    }
    const std::vector<float> got = Download(scene.gaussians);
    for (size_t i = 0; i < size; ++i) {
      ASSERT_NEAR(got[i], want[i], 2e-6 * std::max(1.0, std::abs(want[i]))) << step << " " << i;
    }
    scene.Render();
    scene.Backward(RandomValues(3 * 60 * 45, 9 + step));
  }
}

// Two views of the same Gaussians, each with a scratch of its own: both gradients are those at the
// start, then Adam does two steps.
TEST_P(UpdateTest, DoesStepsOfSeveralViewsWithTheGradientsAtTheStart) {
  const HostGaussians host = RandomScene({.count = 137});
  Rendered first(*backend_, host, TestView(60, 45)), second(*backend_, host, TestView(45, 60));
  std::vector<std::vector<float>> grads;
  for (Rendered* scene : {&first, &second}) {
    scene->Render();
    scene->Backward(RandomValues(3 * 60 * 45, 9));
    grads.push_back(scene->ParameterGradient());
  }
  const UpdateStep steps[] = {{.view = first.view, .scratch = &first.scratch},
                              {.view = second.view, .scratch = &second.scratch}};
  Buffer<int32_t> num_visible(*backend_, host.count);
  UpdateArgs args = first.MakeUpdateArgs();
  args.steps = steps;
  args.stats.num_visible = num_visible.span();
  backend_->Update(args);

  const size_t size = host.planes.size();
  std::vector<double> want(host.planes.begin(), host.planes.end()), moment1(size), moment2(size);
  for (int step = 1; step <= 2; ++step) {
    const AdamRates<double> rates = {args.beta1, args.beta2, args.epsilon,
                                     1 / (1 - std::pow(args.beta1, step)),
                                     1 / std::sqrt(1 - std::pow(args.beta2, step))};
    for (size_t i = 0; i < size; ++i) {
      const double rate = RateOf(args.learning_rates, static_cast<int>(i / host.count));
      want[i] += AdamStep<double>(rates, rate, grads[step - 1][i], moment1[i], moment2[i]);
    }
  }
  const std::vector<float> got = Download(first.gaussians);
  const std::vector<int32_t> num_steps = Download(first.num_steps);
  int num_complete = 0;
  for (size_t i = 0; i < size; ++i) {
    const size_t gaussian = i % static_cast<size_t>(host.count);
    if (num_steps[gaussian] != 2) continue;  // a gradient was not finite
    ++num_complete;
    ASSERT_NEAR(got[i], want[i], 2e-6 * std::max(1.0, std::abs(want[i]))) << i;
  }
  EXPECT_GT(num_complete, static_cast<int>(size) * 9 / 10);
  const std::vector<int32_t> seen = Download(num_visible);
  EXPECT_EQ(*std::max_element(seen.begin(), seen.end()), 2);
}

TEST_P(UpdateTest, MovesAGaussianOutOfSightByItsMoments) {
  HostGaussians host = RandomScene({.count = 20});
  host.At(kMeanPlane + 2, 7) = -50;  // behind the camera
  Rendered scene = Stepped(host);
  std::vector<float> moment1(host.planes.size()), moment2(host.planes.size());
  moment1[7] = 0.3f;  // of x of Gaussian 7
  moment2[7] = 0.5f;
  scene.moment1.Upload(moment1);
  scene.moment2.Upload(moment2);
  backend_->Update(scene.MakeUpdateArgs());
  // One step of Adam with gradient 0: both moments decay, and the corrections are those of step 1.
  const double want = -1e-3 * 10 * 0.27 / (std::sqrt(0.4995 / 0.001));
  EXPECT_NEAR(Download(scene.gaussians)[7] - host.planes[7], want, 1e-7);
  EXPECT_NEAR(Download(scene.moment1)[7], 0.27f, 1e-6f);
}

TEST_P(UpdateTest, KeepsLogScalesWithinTheirBounds) {
  Rendered scene = Stepped(RandomScene({.count = 50}));
  UpdateArgs args = scene.MakeUpdateArgs();
  args.learning_rates.log_scale = 10;
  args.min_log_scale = -5;
  args.max_log_scale = -1;
  backend_->Update(args);
  const std::vector<float> got = Download(scene.gaussians);
  int num_at_bound = 0;
  for (int64_t i = kLogScalePlane * 50; i < kRotationPlane * 50; ++i) {
    EXPECT_GE(got[i], -5);
    EXPECT_LE(got[i], -1);
    num_at_bound += got[i] == -5 || got[i] == -1;
  }
  EXPECT_GT(num_at_bound, 50);
}

TEST_P(UpdateTest, CountsTheStepsOfEachGaussian) {
  Rendered scene = Stepped(RandomScene({.count = 30}));
  std::vector<int32_t> steps(30);
  steps[4] = 100;
  scene.num_steps.Upload(steps);
  const std::vector<float> grad = scene.ParameterGradient();
  ASSERT_NE(grad[kOpacityPlane * 30 + 5], 0);
  backend_->Update(scene.MakeUpdateArgs());
  const std::vector<int32_t> after = Download(scene.num_steps);
  EXPECT_EQ(after[4], 101);
  EXPECT_EQ(after[5], 1);
  // A first step is as long as the learning rate, however many steps other Gaussians have done.
  const float moved =
      Download(scene.gaussians)[kOpacityPlane * 30 + 5] - scene.host.At(kOpacityPlane, 5);
  EXPECT_NEAR(std::abs(moved), 5e-2f, 1e-5f);
}

// Returns for each Gaussian whether the gradient of its splat is finite, or it has no splat.
std::vector<bool> HasFiniteGradient(const Rendered& scene) {
  std::vector<bool> finite(static_cast<size_t>(scene.host.count), true);
  const auto visible = Download(scene.scratch.visible_gaussian);
  const auto grads = Download(scene.scratch.visible_grad);
  for (size_t i = 0; i < visible.size(); ++i) {
    const SplatGrad& g = grads[i];
    finite[visible[i]] = std::isfinite(g.x + g.y + g.conic_xx + g.conic_xy + g.conic_yy +
                                       g.opacity + g.r + g.g + g.b + g.depth + g.squares);
  }
  return finite;
}

TEST_P(UpdateTest, SkipsAndCountsRowsWithoutAFiniteGradient) {
  Rendered scene(*backend_, RandomScene({.count = 40, .max_scale = 0.05f}), TestView(60, 45));
  scene.Render();
  std::vector<float> color_grad = RandomValues(3 * 60 * 45, 9);
  // NaN in five scanlines reaches the Gaussians that are seen there.
  std::fill_n(color_grad.begin() + 60 * 20, 60 * 5, std::numeric_limits<float>::quiet_NaN());
  scene.Backward(color_grad);
  const std::vector<bool> is_finite = HasFiniteGradient(scene);
  backend_->Update(scene.MakeUpdateArgs());
  const std::vector<float> got = Download(scene.gaussians);
  const std::vector<int32_t> steps = Download(scene.num_steps);
  int64_t num_skipped = 0;
  for (int64_t i = 0; i < 40; ++i) {
    // A splat's gradient that is not finite may end at a clamp, which leaves those of the
    // parameters finite.
    const bool skipped = steps[i] == 0;
    num_skipped += skipped;
    EXPECT_FALSE(skipped && is_finite[i]) << i;
    for (int plane = 0; plane < NumPlanes(3); ++plane) {
      ASSERT_TRUE(std::isfinite(got[plane * 40 + i]));
      if (skipped) {
        ASSERT_EQ(got[plane * 40 + i], scene.host.At(plane, i));
      }
    }
  }
  EXPECT_GT(num_skipped, 0);
  EXPECT_LT(num_skipped, 40);
  EXPECT_EQ(scene.Counter(kNumSkippedGradientRows), num_skipped);
}

TEST_P(UpdateTest, LeavesCoefficientsBeyondTheActiveDegreeAlone) {
  Rendered scene = Stepped(RandomScene({.count = 30}));
  UpdateArgs args = scene.MakeUpdateArgs();
  args.active_sh_degree = 1;
  backend_->Update(args);
  const std::vector<float> got = Download(scene.gaussians);
  const int64_t first = (kShPlane + 3 * NumShCoefficients(1)) * 30;
  for (int64_t i = first; i < scene.gaussians.size(); ++i) ASSERT_EQ(got[i], scene.host.planes[i]);
  EXPECT_NE(got[first - 25], scene.host.planes[first - 25]);
}

TEST_P(UpdateTest, AccumulatesTheStatisticsOfDensityControl) {
  HostGaussians host = RandomScene({.count = 20});
  for (int k = 0; k < 3; ++k) {
    host.At(kMeanPlane + k, 3) = 0;
    host.At(kLogScalePlane + k, 3) = std::log(0.1f);
  }
  host.At(kMeanPlane + 2, 8) = -50;  // out of sight
  Rendered scene = Stepped(host);
  Buffer<float> grad_sum(*backend_, 20), square_sum(*backend_, 20), radius(*backend_, 20);
  Buffer<int32_t> num_visible(*backend_, 20);
  UpdateArgs args = scene.MakeUpdateArgs();
  args.stats = {grad_sum.span(), square_sum.span(), num_visible.span(), radius.span()};
  args.learning_rates = {};
  backend_->Update(args);
  backend_->Update(args);
  EXPECT_EQ(Download(num_visible)[8], 0);
  EXPECT_EQ(Download(num_visible)[3], 2);
  EXPECT_EQ(Download(grad_sum)[8], 0);
  const auto visible = Download(scene.scratch.visible_gaussian);
  const auto at = std::find(visible.begin(), visible.end(), 3) - visible.begin();
  const SplatGrad grad = Download(scene.scratch.visible_grad)[at];
  EXPECT_NEAR(Download(grad_sum)[3], 2 * std::hypot(30 * grad.x, 22.5f * grad.y),
              1e-5f * Download(grad_sum)[3]);
  EXPECT_EQ(Download(square_sum)[8], 0);
  EXPECT_GT(grad.squares, 0);
  EXPECT_FLOAT_EQ(Download(square_sum)[3], 2 * grad.squares);
  // The dilated image of a ball with a deviation of 0.1 at z = 2.2 near the axis.
  const float sigma_y = 0.1f * 0.95f * 60 / 2.2f;
  EXPECT_NEAR(Download(radius)[3], 3 * std::sqrt(sigma_y * sigma_y + 0.3f), 0.05f);
}

}  // namespace
}  // namespace pepeseg
