#include <gtest/gtest.h>

#include <cmath>

#include "kernels/math/adam.h"
#include "tests/kernels/backend_test.h"
#include "tests/kernels/reference_gradient.h"
#include "tests/kernels/rendered.h"

// Whole steps of training: the losses they lead to, and that the number of threads does not matter.

namespace pepeseg {
namespace {

constexpr int kViewWidth = 75, kViewHeight = 50;

class TrainingTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, TrainingTest, AllBackends(), BackendName);

// Runs one step with the mean squared error against an image, and returns that error.
double Step(Rendered& scene, const std::vector<float>& target) {
  scene.Render();
  std::vector<float> grad = Download(scene.color);
  double loss = 0;
  const auto size = static_cast<double>(grad.size());
  for (size_t i = 0; i < grad.size(); ++i) {
    const float difference = grad[i] - target[i];
    loss += double{difference} * difference / size;
    grad[i] = static_cast<float>(2 * difference / size);
  }
  scene.Backward(grad);
  scene.backend.Update(scene.MakeUpdateArgs());
  return loss;
}

// The image to be learnt, of another random scene.
std::vector<float> Target(Backend& backend) {
  Rendered scene(backend, RandomScene({.count = 250, .seed = 21}),
                 TestView(kViewWidth, kViewHeight));
  scene.Render();
  return Download(scene.color);
}

// The scene that training starts from.
Rendered Start(Backend& backend) {
  return Rendered(backend, RandomScene({.count = 250, .seed = 22}),
                  TestView(kViewWidth, kViewHeight));
}

// The losses were recorded with AVX-512. The reference in double below has the same.
TEST_P(TrainingTest, GivesTheGoldenLossesInTenSteps) {
  constexpr double kLosses[10] = {0.0670913564, 0.0651686438, 0.0632613104, 0.0613901937,
                                  0.0595468026, 0.0576901641, 0.0559335160, 0.0542146217,
                                  0.0525438171, 0.0509188301};
  constexpr double kSumOfSquares = 8589.85285;
  const std::vector<float> target = Target(*backend_);
  Rendered scene = Start(*backend_);
  for (int step = 0; step < 10; ++step) {
    EXPECT_NEAR(Step(scene, target), kLosses[step], 1e-5 * kLosses[step]) << step;
  }
  double sum_of_squares = 0;
  for (const float value : Download(scene.gaussians)) sum_of_squares += double{value} * value;
  EXPECT_NEAR(sum_of_squares, kSumOfSquares, 1e-6 * kSumOfSquares);
}

// Returns the losses of the same ten steps in double, with the reference's renderer and gradients.
std::vector<double> ReferenceLosses(const std::vector<float>& target, const Rendered& start) {
  ReferenceScene scene = {
      start.host.count, start.host.sh_degree, {start.host.planes.begin(), start.host.planes.end()}};
  const ReferenceOptions options = {.near_plane = 0.05};
  const LearningRates r = {1e-3f, 5e-3f, 1e-3f, 5e-2f, 2.5e-3f, 1.25e-4f};
  std::vector<double> moment1(scene.planes.size()), moment2(scene.planes.size()), losses;
  for (int step = 1; step <= 10; ++step) {
    const ReferenceImage image = RenderReference(scene, start.view, options);
    ImageGrad grad = {image.color, std::vector<double>(image.alpha.size()),
                      std::vector<double>(image.alpha.size())};
    losses.push_back(0);
    const auto size = static_cast<double>(target.size());
    for (size_t i = 0; i < target.size(); ++i) {
      const double difference = image.color[i] - target[i];
      losses.back() += difference * difference / size;
      grad.color[i] = 2 * difference / size;
    }
    const std::vector<double> gradient = ReferenceGradient(scene, start.view, options, grad);
    const AdamRates<double> rates = {0.9, 0.999, 1e-15, 1 / (1 - std::pow(0.9, step)),
                                     1 / std::sqrt(1 - std::pow(0.999, step))};
    for (size_t i = 0; i < gradient.size(); ++i) {
      const auto plane = static_cast<int>(i / scene.count);
      const double rate = plane < kLogScalePlane   ? r.mean
                          : plane < kRotationPlane ? r.log_scale
                          : plane < kOpacityPlane  ? r.rotation
                          : plane < kShPlane       ? r.opacity
                          : plane < kShPlane + 3   ? r.sh_dc
                                                   : r.sh_rest;
      scene.planes[i] += AdamStep(rates, rate, gradient[i], moment1[i], moment2[i]);
    }
  }
  return losses;
}

TEST_P(TrainingTest, FollowsTheDoubleReferenceForTenSteps) {
  const std::vector<float> target = Target(*backend_);
  Rendered scene = Start(*backend_);
  const std::vector<double> want = ReferenceLosses(target, scene);
  for (int step = 0; step < 10; ++step) {
    EXPECT_NEAR(Step(scene, target), want[step], 2e-5 * want[step]) << step;
  }
}

TEST_P(TrainingTest, LowersTheLoss) {
  const std::vector<float> target = Target(*backend_);
  Rendered scene = Start(*backend_);
  const double first = Step(scene, target);
  double last = first;
  for (int step = 0; step < 150; ++step) last = Step(scene, target);
  EXPECT_LT(last, first / 4);
}

// Everything that must be equal to the last bit.
struct Outcome {
  std::vector<float> color, depth, gaussians, moment2;
  std::vector<int32_t> visible, entries;
};

Outcome TrainWith(int num_threads) {
  const auto backend = MakeCpuBackend(num_threads);
  const std::vector<float> target = Target(*backend);
  // More Gaussians than any loop's chunk.
  Rendered scene(*backend, RandomScene({.count = 5000, .seed = 23}),
                 TestView(kViewWidth, kViewHeight));
  for (int step = 0; step < 4; ++step) Step(scene, target);
  return {Download(scene.color),
          Download(scene.depth),
          Download(scene.gaussians),
          Download(scene.moment2),
          Download(scene.scratch.visible_gaussian),
          Download(scene.scratch.entry_visible)};
}

TEST(TrainingOnCpu, GivesTheSameBytesForAnyNumberOfThreads) {
  const Outcome one = TrainWith(1);
  for (const int num_threads : {2, 3}) {
    const Outcome more = TrainWith(num_threads);
    EXPECT_EQ(one.color, more.color);
    EXPECT_EQ(one.depth, more.depth);
    EXPECT_EQ(one.gaussians, more.gaussians);
    EXPECT_EQ(one.moment2, more.moment2);
    EXPECT_EQ(one.visible, more.visible);
    EXPECT_EQ(one.entries, more.entries);
  }
}

}  // namespace
}  // namespace pepeseg
