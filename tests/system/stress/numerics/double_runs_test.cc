#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "core/scene/camera.h"
#include "kernels/math/adam.h"
#include "tests/kernels/reference_gradient.h"
#include "tests/kernels/rendered.h"
#include "tests/system/stress/numerics/double_image_loss.h"
#include "tests/system/stress/numerics/measured.h"
#include "tests/system/stress/numerics/tiny_runs.h"
#include "tests/testing/full_stress.h"

// Compares 1,000 steps of stage one in single precision with the same in double: the same
// Gaussians, views and order of views. Rounding errors grow, since blending and Adam's quotient are
// not smooth where a splat passes a threshold or a gradient passes zero. The losses must still stay
// close.

namespace pepeseg::testing {
namespace {

constexpr int kSide = 32;
constexpr float kNear = 0.04f, kSsimWeight = 0.2f;
const LearningRates kRates = {6e-4f, 5e-3f, 1e-3f, 5e-2f, 2.5e-3f, 1.25e-4f};

int NumRunSteps() { return FullStress() ? 1'000 : 300; }

HostGaussians StartOf(const Capture& capture) {
  HostGaussians start = {static_cast<int64_t>(capture.points.size()), 1, {}};
  start.planes.resize(start.count * NumPlanes(start.sh_degree));
  for (int64_t i = 0; i < start.count; ++i) {
    for (int k = 0; k < 3; ++k) {
      start.At(kMeanPlane + k, i) = capture.points[i].position[k];
      start.At(kLogScalePlane + k, i) = -1.6f;
      start.At(kShPlane + k, i) = (capture.points[i].rgb[k] / 255.0f - 0.5f) / 0.2820948f;
    }
    start.At(kRotationPlane, i) = 1;
    start.At(kOpacityPlane, i) = -1;
  }
  return start;
}

// Trains by the ops of a backend.
class SingleTrainer {
 public:
  SingleTrainer(Backend& backend, const HostGaussians& start)
      : backend_(backend),
        start_(start),
        gaussians_(Upload(backend, start.planes)),
        moment1_(backend, gaussians_.size()),
        moment2_(backend, gaussians_.size()),
        num_steps_(backend, start.count),
        color_(backend, 3 * kSide * kSide),
        color_grad_(backend, 3 * kSide * kSide),
        sums_(backend, kNumImageLossSums) {}

  double Step(const PinholeView& view, const Buffer<uint8_t>& photo) {
    const int degree = start_.sh_degree;
    backend_.Render({.gaussians = PlanesIn(gaussians_, start_),
                     .view = view,
                     .near_plane = kNear,
                     .active_sh_degree = degree,
                     .scratch = &scratch_,
                     .color = color_.span()});
    backend_.ImageLoss({.width = kSide,
                        .height = kSide,
                        .color = color_.span(),
                        .target = photo.span(),
                        .ssim_weight = kSsimWeight,
                        .color_grad = color_grad_.span(),
                        .sums = sums_.span()});
    backend_.RenderBackward({.view = view, .color_grad = color_grad_.span(), .scratch = &scratch_});
    const UpdateStep step = {.view = view, .scratch = &scratch_};
    backend_.Update({.steps = {&step, 1},
                     .active_sh_degree = degree,
                     .learning_rates = kRates,
                     .gaussians = PlanesIn(gaussians_, start_),
                     .moment1 = PlanesIn(moment1_, start_),
                     .moment2 = PlanesIn(moment2_, start_),
                     .num_steps = num_steps_.span(),
                     .stats = {}});
    const std::vector<double> sums = Download(sums_);
    const double num = sums[kSumPixelChannels];
    return (1 - kSsimWeight) * sums[kSumL1] / num + kSsimWeight * (1 - sums[kSumSsim] / num);
  }

  std::vector<float> Parameters() const { return Download(gaussians_); }

 private:
  Backend& backend_;
  const HostGaussians& start_;
  Buffer<float> gaussians_, moment1_, moment2_;
  Buffer<int32_t> num_steps_;
  Buffer<float> color_, color_grad_;
  Buffer<double> sums_;
  RenderScratch scratch_;
};

class DoubleTrainer {
 public:
  explicit DoubleTrainer(const HostGaussians& start)
      : scene_{start.count, start.sh_degree, {start.planes.begin(), start.planes.end()}},
        moment1_(scene_.planes.size()),
        moment2_(scene_.planes.size()) {}

  double Step(const PinholeView& view, const std::vector<uint8_t>& photo) {
    const ReferenceOptions options = {.near_plane = kNear};
    const ReferenceImage image = RenderReference(scene_, view, options);
    const DoubleLoss loss = DoubleImageLoss(image.color, photo, kSide, double{kSsimWeight});
    const std::vector<double> none(image.alpha.size());
    const std::vector<double> gradient =
        ReferenceGradient(scene_, view, options, {loss.color_grad, none, none});
    ++step_;
    const double beta1 = double{0.9f}, beta2 = double{0.999f};
    const AdamRates<double> rates = {beta1, beta2, 1e-15, 1 / (1 - std::pow(beta1, step_)),
                                     1 / std::sqrt(1 - std::pow(beta2, step_))};
    for (size_t i = 0; i < gradient.size(); ++i) {
      scene_.planes[i] +=
          AdamStep(rates, RateOf(static_cast<int64_t>(i)), gradient[i], moment1_[i], moment2_[i]);
    }
    return loss.loss;
  }

  const std::vector<double>& Parameters() const { return scene_.planes; }

 private:
  double RateOf(int64_t i) const {
    const auto plane = static_cast<int>(i / scene_.count);
    if (plane < kLogScalePlane) return double{kRates.mean};
    if (plane < kRotationPlane) return double{kRates.log_scale};
    if (plane < kOpacityPlane) return double{kRates.rotation};
    if (plane < kShPlane) return double{kRates.opacity};
    return plane < kShPlane + 3 ? double{kRates.sh_dc} : double{kRates.sh_rest};
  }

  ReferenceScene scene_;
  std::vector<double> moment1_, moment2_;
  int step_ = 0;
};

class DoubleRuns : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, DoubleRuns, CpuAndCuda(), BackendName);

double RmsDifference(const std::vector<float>& a, const std::vector<double>& b) {
  double squares = 0;
  for (size_t i = 0; i < a.size(); ++i) squares += std::pow(a[i] - b[i], 2);
  return std::sqrt(squares / static_cast<double>(a.size()));
}

TEST_P(DoubleRuns, AgreeWithFloatInStageOne) {
  const Capture capture =
      TinyCapture({.num_views = 4, .side = kSide, .held_out_every = 0, .num_points = 40});
  const HostGaussians start = StartOf(capture);
  SingleTrainer single(*backend_, start);
  DoubleTrainer wide(start);
  std::vector<Buffer<uint8_t>> photos;
  for (const View& view : capture.views) {
    photos.emplace_back(*backend_, std::span<const uint8_t>(view.photo.pixels));
  }
  double first = 0, of_100 = 0, largest = 0, sum = 0, sum_wide = 0;
  const int last_tenth = NumRunSteps() * 9 / 10;
  for (int step = 0; step < NumRunSteps(); ++step) {
    const size_t at = static_cast<size_t>(step) % capture.views.size();
    const View& view = capture.views[at];
    const PinholeView pinhole = ToPinholeView(view.camera, view.cam_from_world);
    const double loss = single.Step(pinhole, photos[at]);
    const double want = wide.Step(pinhole, view.photo.pixels);
    if (step == 0) first = std::abs(loss - want) / want;
    largest = std::max(largest, std::abs(loss - want) / want);
    if (step >= last_tenth) sum += loss, sum_wide += want;
    if (step < 100) of_100 = largest;
    for (const int mark : {1, 10, 100, 300, 1000}) {
      if (step + 1 == mark) {
        std::printf("step %d: loss %.6f, in double %.6f\n", mark, loss, want);
        ExpectAsMeasured(*backend_, "stage one in double: parameters, step " + std::to_string(mark),
                         RmsDifference(single.Parameters(), wide.Parameters()));
      }
    }
  }
  ExpectAsMeasured(*backend_, "stage one in double: loss, step 1", first);
  ExpectAsMeasured(*backend_, "stage one in double: loss, 100 steps", of_100);
  ExpectAsMeasured(*backend_, "stage one in double: loss, all steps", largest);
  ExpectAsMeasured(*backend_, "stage one in double: mean loss of the last tenth",
                   std::abs(sum - sum_wide) / sum_wide);
}

}  // namespace
}  // namespace pepeseg::testing
