
#include "core/features/trainer.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/features/mask_scales.h"
#include "core/features/preparation.h"
#include "core/render/renderer.h"
#include "kernels/gaussian_planes.h"
#include "tests/core/features/blob_scene.h"
#include "tests/core/features/perception_scene.h"
#include "tests/kernels/backend_test.h"
#include "tests/testing/point_gaussians.h"
#include "tests/testing/run_trainers.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

constexpr FeatureOptions kShort = {.num_steps = 30,
                                   .num_pixels = 60,
                                   .num_scales = 5,
                                   .centroid_weight_lower = 0.3f,
                                   .steps_per_chunk = 7};

absl::Status Go(const StepReport&) { return absl::OkStatus(); }

Capture SmallCapture() {
  return testing::MakeSyntheticScene({.num_views = 6, .num_points = 1500}).capture;
}

// Returns a capture for which no part of the loss is skipped: it has depth priors, and some views
// lack masks.
Capture CaptureWithGaps() {
  Capture capture = testing::MakeSyntheticScene(
                        {.num_views = 6, .num_points = 1500, .depth = DepthPrior::Kind::kDisparity})
                        .capture;
  testing::DropMasks(capture);
  return capture;
}

TEST(FeatureTrainer, ReturnsTheSameBytesForAnyNumberOfThreads) {
  const Capture capture = CaptureWithGaps();
  const Gaussians gaussians = testing::PointGaussians(capture, 0.06f);
  ASSERT_OK_AND_ASSIGN(const FeatureField one,
                       testing::TrainFeatures(*MakeCpuBackend(1), capture, gaussians, kShort, Go));
  for (const int threads : {2, 3}) {
    ASSERT_OK_AND_ASSIGN(
        const FeatureField other,
        testing::TrainFeatures(*MakeCpuBackend(threads), capture, gaussians, kShort, Go));
    EXPECT_EQ(one.features, other.features);
    EXPECT_EQ(one.confidence, other.confidence);
    EXPECT_EQ(one.gate, other.gate);
    EXPECT_EQ(one.scale_quantiles, other.scale_quantiles);
  }
}

// Snapshots between steps before and after the end of smoothing.
TEST(FeatureTrainer, TrainsTheSameFieldWithSnapshots) {
  const Capture capture = CaptureWithGaps();
  const Gaussians gaussians = testing::PointGaussians(capture, 0.06f);
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const FeatureField without,
                       testing::TrainFeatures(*backend, capture, gaussians, kShort, Go));
  ASSERT_OK_AND_ASSIGN(const auto stage,
                       FeatureTrainer::Create(*backend, capture, gaussians, kShort));
  FeatureField snapshot;
  while (!stage->done()) {
    ASSERT_OK(stage->Step());
    if (stage->step() % 5 == 0) snapshot = stage->Snapshot();
  }
  const FeatureField field = stage->Result();
  EXPECT_EQ(field.features, without.features);
  EXPECT_EQ(field.gate, without.gate);
  EXPECT_EQ(snapshot.features, field.features);  // of the last step
  EXPECT_EQ(snapshot.confidence, field.confidence);
}

// Two layers resume from checkpoints, do not depend on the number of threads, and every number of
// the gate learns.
TEST(FeatureTrainer, TrainsAGateOfTwoLayers) {
  const Capture capture = CaptureWithGaps();
  const Gaussians gaussians = testing::PointGaussians(capture, 0.06f);
  FeatureOptions options = kShort;
  options.gate_layers = 2;
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto stage,
                       FeatureTrainer::Create(*backend, capture, gaussians, options));
  const std::vector<float> initial = stage->Result().gate;
  for (int i = 0; i < 5; ++i) ASSERT_OK(stage->Step());
  ASSERT_OK_AND_ASSIGN(const FeatureCheckpoint checkpoint, stage->Save());
  ASSERT_OK_AND_ASSIGN(const FeatureField field, RunSteps(*stage, Go));
  ASSERT_EQ(field.gate.size(), static_cast<size_t>(kTwoLayerGateSize));
  EXPECT_EQ(initial.size(), field.gate.size());
  int num_moved = 0;
  for (size_t i = 0; i < initial.size(); ++i) num_moved += initial[i] != field.gate[i];
  // Hidden units that are 0 at all scales do not learn.
  EXPECT_GT(num_moved, kTwoLayerGateSize / 2);
  const auto one_thread = MakeCpuBackend(1);
  ASSERT_OK_AND_ASSIGN(const auto resumed, FeatureTrainer::Resume(*one_thread, capture, gaussians,
                                                                  options, checkpoint));
  ASSERT_OK_AND_ASSIGN(const FeatureField again, RunSteps(*resumed, Go));
  EXPECT_EQ(again.gate, field.gate);
  EXPECT_EQ(again.features, field.features);
}

TEST(FeatureTrainer, DoesNotDependOnTheChunkSize) {
  const Capture capture = SmallCapture();
  const Gaussians gaussians = testing::PointGaussians(capture, 0.06f);
  const auto backend = MakeCpuBackend(2);
  FeatureOptions options = kShort;
  ASSERT_OK_AND_ASSIGN(const FeatureField a,
                       testing::TrainFeatures(*backend, capture, gaussians, options, Go));
  options.steps_per_chunk = 1000;
  ASSERT_OK_AND_ASSIGN(const FeatureField b,
                       testing::TrainFeatures(*backend, capture, gaussians, options, Go));
  EXPECT_EQ(a.features, b.features);
}

TEST(FeatureTrainer, ReportsAConfidenceForEachFeature) {
  Capture capture = SmallCapture();
  const Gaussians gaussians = testing::PointGaussians(capture, 0.06f);
  const auto backend = MakeCpuBackend(2);
  FeatureOptions options = kShort;
  ASSERT_OK_AND_ASSIGN(const FeatureField field,
                       testing::TrainFeatures(*backend, capture, gaussians, options, Go));
  ASSERT_EQ(static_cast<int64_t>(field.confidence.size()), gaussians.count);
  int64_t num_confident = 0, num_doubtful = 0;
  for (int64_t i = 0; i < gaussians.count; ++i) {
    const float* feature = &field.features[i * 32];
    if (std::all_of(feature, feature + 32, [](float f) { return f == 0; })) {
      EXPECT_EQ(field.confidence[i], 1) << "Gaussian " << i << " has no feature";
      continue;
    }
    EXPECT_GT(field.confidence[i], 0);
    (field.confidence[i] == 1 ? num_confident : num_doubtful) += 1;
  }
  EXPECT_GT(num_confident, 100);
  EXPECT_GT(num_doubtful, 100);
  options.min_confident_views = 0;
  ASSERT_OK_AND_ASSIGN(const FeatureField alike,
                       testing::TrainFeatures(*backend, capture, gaussians, options, Go));
  EXPECT_TRUE(alike.confidence.empty());
  EXPECT_EQ(alike.features, field.features);
}

// Returns the loss of the first step on one masked blob of this opacity, given as a logit.
double FirstLoss(float opacity, float min_norm_alpha) {
  testing::BlobScene scene({{{48, 48, true}}});
  scene.gaussians.Plane(kOpacityPlane)[0] = opacity;
  FeatureOptions options = kShort;
  options.num_steps = 1;
  options.min_norm_alpha = min_norm_alpha;
  double loss = -1;
  EXPECT_OK(testing::TrainFeatures(*MakeCpuBackend(1), scene.capture, scene.gaussians, options,
                                   [&](const StepReport& report) {
                                     loss = report.loss;
                                     return absl::OkStatus();
                                   }));
  return loss;
}

// The feature of a pixel is at most as long as its alpha, so the norm loss of a pixel whose alpha
// is 0.7 is at least 0.09.
TEST(FeatureTrainer, CountsPixelsInTheNormLossWhoseAlphaIsOverTheMinimum) {
  const float faint = 0.847f, opaque = 20;  // logits; 0.847 is that of 0.7
  EXPECT_GT(FirstLoss(faint, 0), FirstLoss(faint, 0.9f) + 0.09);
  EXPECT_EQ(FirstLoss(faint, 0.71f), FirstLoss(faint, 0.9f)) << "no alpha is over 0.71";
  // The mask of the opaque blob has pixels of every alpha from 0.1 on.
  EXPECT_GT(FirstLoss(opaque, 0), FirstLoss(opaque, 0.9f));
  EXPECT_EQ(FirstLoss(opaque, 0), FirstLoss(opaque, 0.05f)) << "no alpha is under 0.05";
}

TEST(FeatureTrainer, LowersTheLossAndNormalisesFeatures) {
  const Capture capture = SmallCapture();
  const Gaussians gaussians = testing::PointGaussians(capture, 0.06f);
  FeatureOptions options = kShort;
  options.num_steps = 200;
  double first = 0, last = 0;
  int64_t reports = 0;
  const auto progress = [&](const StepReport& report) {
    EXPECT_EQ(report.step, ++reports);
    EXPECT_EQ(report.num_steps, 200);
    (report.step <= 20 ? first : last) += report.step <= 20 || report.step > 180 ? report.loss : 0;
    return absl::OkStatus();
  };
  ASSERT_OK_AND_ASSIGN(
      const FeatureField field,
      testing::TrainFeatures(*MakeCpuBackend(2), capture, gaussians, options, progress));
  EXPECT_LT(last, first);
  EXPECT_EQ(field.scale_quantiles.size(), 1000u);
  int64_t num_trained = 0;
  for (int64_t i = 0; i < gaussians.count; ++i) {
    double squares = 0;
    for (int k = 0; k < 32; ++k) squares += std::pow(field.features[i * 32 + k], 2);
    EXPECT_TRUE(squares == 0 || std::abs(squares - 1) < 1e-5);
    num_trained += squares > 0 ? 1 : 0;
  }
  EXPECT_GT(num_trained, 200);
}

Eigen::Map<const Eigen::VectorXf> FeatureOf(const FeatureField& field, int64_t gaussian) {
  return {field.features.data() + gaussian * 32, 32};
}

// Each Gaussian has a twin at its side, which is its only neighbour. Smoothed, twins have one
// feature.
TEST(FeatureTrainer, LetsNeighborsDifferAfterTheEndOfSmoothing) {
  const Capture capture = SmallCapture();
  const Gaussians points = testing::PointGaussians(capture, 0.06f);
  std::vector<int64_t> twice;
  for (int64_t i = 0; i < points.count; ++i) twice.insert(twice.end(), 2, i);
  Gaussians gaussians = points.Select(twice);
  for (int64_t i = 1; i < gaussians.count; i += 2) gaussians.Plane(kMeanPlane)[i] += 1e-4f;
  const auto most_of_difference = [&](double smooth_until) {
    FeatureOptions options = kShort;
    options.num_neighbors = 2;
    options.num_drawn_neighbors = 2;
    options.smooth_until = smooth_until;
    const FeatureField field =
        testing::TrainFeatures(*MakeCpuBackend(2), capture, gaussians, options, Go).value();
    float most = 0;
    for (int64_t i = 0; i < gaussians.count; i += 2) {
      most = std::max(most, (FeatureOf(field, i) - FeatureOf(field, i + 1)).norm());
    }
    return most;
  };
  EXPECT_LT(most_of_difference(1), 1e-6);
  EXPECT_GT(most_of_difference(0.5), 1e-2);
}

// A Gaussian that no photograph shows gets the mean feature of those around it that were sampled,
// also where smoothing has ended. Of those around it, some were not: hence not the mean of all.
TEST(FeatureTrainer, GivesUnseenGaussiansTheFeatureOfTheirNeighbors) {
  const Capture capture = SmallCapture();
  Gaussians gaussians = testing::PointGaussians(capture, 0.06f);
  for (int64_t i = 0; i < gaussians.count; i += 10) gaussians.Plane(kOpacityPlane)[i] = -20;
  ASSERT_OK_AND_ASSIGN(const FeatureField field,
                       testing::TrainFeatures(*MakeCpuBackend(2), capture, gaussians, kShort, Go));
  const std::vector<int32_t> nearest = NearestNeighbors(gaussians, kShort.num_neighbors);
  int num_filled = 0;
  for (int64_t i = 0; i < gaussians.count; i += 10) {
    Eigen::VectorXf mean = Eigen::VectorXf::Zero(32);
    for (int k = 1; k < kShort.num_neighbors; ++k) {
      const int32_t other = nearest[i * kShort.num_neighbors + k];
      if (other % 10 != 0) mean += FeatureOf(field, other);
    }
    if (mean.norm() == 0) continue;
    EXPECT_GT(FeatureOf(field, i).dot(mean.normalized()), 0.6f) << i;
    ++num_filled;
  }
  EXPECT_GT(num_filled, 50);
}

// Compares the whole stage. A pair whose cosine rounds to the other side of a threshold changes a
// loss by about 3e-3, which may grow to 6e-2 at a single later step while the features still have a
// cosine of 0.9999. Noise of 1e-7 to 1e-5 has the same effect on the CPU.
TEST(FeatureTrainer, OnCudaLearnsWhatTheCpuLearns) {
  const auto cuda = MakeCuda();
  if (cuda == nullptr) GTEST_SKIP() << "this machine has no Cuda";
  const Capture capture = CaptureWithGaps();
  const Gaussians gaussians = testing::PointGaussians(capture, 0.06f);
  // On both devices, because a step of several at once has features without the others' updates.
  FeatureOptions options = kShort;
  options.views_at_once = 2;
  const auto train = [&](Backend& backend, double& mean_loss) {
    return testing::TrainFeatures(backend, capture, gaussians, options,
                                  [&](const StepReport& report) {
                                    mean_loss += report.loss / kShort.num_steps;
                                    return absl::OkStatus();
                                  });
  };
  double loss = 0, cuda_loss = 0, again = 0;
  ASSERT_OK_AND_ASSIGN(const FeatureField want, train(*MakeCpuBackend(2), loss));
  ASSERT_OK_AND_ASSIGN(const FeatureField got, train(*cuda, cuda_loss));
  EXPECT_NEAR(cuda_loss, loss, 0.01);
  double cosine = 0, num_trained = 0;
  for (size_t i = 0; i < want.features.size(); ++i) {
    cosine += double{got.features[i]} * want.features[i];
    num_trained += std::pow(want.features[i], 2);
  }
  EXPECT_GT(num_trained, 100);
  EXPECT_GT(cosine, 0.999 * num_trained);
  ASSERT_OK_AND_ASSIGN(const FeatureField once_more, train(*cuda, again));
  EXPECT_EQ(got.features, once_more.features);
  EXPECT_EQ(got.gate, once_more.gate);
}

TEST(FeatureStepsAtOnce, FillAGpuWithSmallScenes) {
  EXPECT_EQ(FeatureStepsAtOnce(8, 200'000, {}), 2);
  EXPECT_EQ(FeatureStepsAtOnce(8, 1'000'000, {}), 1);
  EXPECT_EQ(FeatureStepsAtOnce(1, 200'000, {}), 1);
  EXPECT_EQ(FeatureStepsAtOnce(1, 1'000'000, {.views_at_once = 3}), 3);
}

// Steps that are done at once do not see each other's updates.
TEST(FeatureTrainer, LearnsAlmostTheSameFromSeveralStepsAtOnce) {
  const Capture capture = CaptureWithGaps();
  const Gaussians gaussians = testing::PointGaussians(capture, 0.06f);
  const auto backend = MakeCpuBackend(2);
  const auto train = [&](int views_at_once, double& last_loss) {
    FeatureOptions options = kShort;
    options.num_steps = 200;
    options.steps_per_chunk = 50;
    options.views_at_once = views_at_once;
    return testing::TrainFeatures(*backend, capture, gaussians, options,
                                  [&](const StepReport& report) {
                                    if (report.step > 160) last_loss += report.loss / 40;
                                    return absl::OkStatus();
                                  });
  };
  double loss = 0, loss_at_once = 0;
  ASSERT_OK_AND_ASSIGN(const FeatureField one, train(1, loss));
  ASSERT_OK_AND_ASSIGN(const FeatureField four, train(4, loss_at_once));
  EXPECT_NE(four.features, one.features);
  EXPECT_NEAR(loss_at_once, loss, 0.05);
}

std::vector<std::string> SkippedOf(const Capture& capture, const FeatureOptions& options) {
  const auto backend = MakeCpuBackend(2);
  const auto stage =
      FeatureTrainer::Create(*backend, capture, testing::PointGaussians(capture, 0.06f), options);
  EXPECT_OK(stage.status());
  std::vector<std::string> lines;
  for (const SkippedPart& skipped : (*stage)->skipped()) {
    lines.push_back(absl::StrCat(NameOf(skipped.part), ": ", skipped.reason));
  }
  return lines;
}

TEST(FeatureTrainer, ReportsThePartsThatItSkips) {
  using Lines = std::vector<std::string>;
  EXPECT_EQ(SkippedOf(CaptureWithGaps(), kShort), Lines());
  EXPECT_EQ(SkippedOf(SmallCapture(), kShort),
            (Lines{"perception: no training view has a depth prior"}));
  FeatureOptions options = kShort;
  options.num_background_pixels = 0;
  options.centroid_weight_lower = options.centroid_weight_upper = options.perception_weight = 0;
  EXPECT_EQ(SkippedOf(CaptureWithGaps(), options), (Lines{"background: num_background_pixels is 0",
                                                          "centroids: both centroid weights are 0",
                                                          "perception: perception_weight is 0"}));
}

TEST(FeatureTrainer, ReturnsTheErrorOfTheCallback) {
  const Capture capture = SmallCapture();
  const auto stop = [](const StepReport& report) {
    return report.step < 3 ? absl::OkStatus() : absl::CancelledError("enough");
  };
  EXPECT_STATUS(testing::TrainFeatures(*MakeCpuBackend(1), capture,
                                       testing::PointGaussians(capture, 0.06f), kShort, stop),
                absl::StatusCode::kCancelled, "enough");
}

TEST(FeatureTrainer, FailsWithoutMasks) {
  const Capture capture = testing::MakeSyntheticScene({.with_masks = false}).capture;
  EXPECT_STATUS(testing::TrainFeatures(*MakeCpuBackend(1), capture,
                                       testing::PointGaussians(capture, 0.06f), kShort, Go),
                absl::StatusCode::kFailedPrecondition, "no training view has a mask");
}

TEST(FeatureOptions, NameTheFieldThatIsOutOfRange) {
  EXPECT_OK(Validate(FeatureOptions()));
  EXPECT_STATUS(Validate(FeatureOptions{.num_steps = 0}), absl::StatusCode::kInvalidArgument,
                "num_steps is 0");
  EXPECT_STATUS(Validate(FeatureOptions{.min_confident_views = -1}),
                absl::StatusCode::kInvalidArgument,
                "min_confident_views is -1, must be in [0, 64]");
  EXPECT_STATUS(Validate(FeatureOptions{.min_mask_agreement = 1.5}),
                absl::StatusCode::kInvalidArgument, "min_mask_agreement");
  EXPECT_STATUS(Validate(FeatureOptions{.mask_share = 1.5}), absl::StatusCode::kInvalidArgument,
                "mask_share");
  EXPECT_STATUS(Validate(FeatureOptions{.num_pixels = 1}), absl::StatusCode::kInvalidArgument,
                "num_pixels");
  EXPECT_STATUS(Validate(FeatureOptions{.num_scales = 17}), absl::StatusCode::kInvalidArgument,
                "num_scales is 17");
  EXPECT_STATUS(Validate(FeatureOptions{.learning_rate = NAN}), absl::StatusCode::kInvalidArgument,
                "learning_rate");
  EXPECT_STATUS(Validate(FeatureOptions{.smooth_until = 1.5}), absl::StatusCode::kInvalidArgument,
                "smooth_until is 1.5, must be in [0, 1]");
  EXPECT_STATUS(Validate(FeatureOptions{.steps_per_chunk = 0}), absl::StatusCode::kInvalidArgument,
                "steps_per_chunk");
}

}  // namespace
}  // namespace pepeseg
