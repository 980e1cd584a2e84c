#include "core/reconstruct/scene_needs.h"

#include <cmath>
#include <limits>
#include <optional>

#include "core/evaluate/image_scores.h"
#include "core/reconstruct/initial_gaussians.h"
#include "core/reconstruct/trainer.h"
#include "tests/testing/run_trainers.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

// Runs of stage one that skip what the scene does not need.

namespace pepeseg {
namespace {

// Returns a capture with few views, so that windows have 500 steps, the fewest.
Capture Small(std::optional<DepthPrior::Kind> depth = {}) {
  return testing::MakeSyntheticScene(
             {.num_views = 6, .width = 32, .height = 24, .num_points = 120, .depth = depth})
      .capture;
}

ReconstructOptions RunOf(int num_steps) {
  ReconstructOptions options;
  options.num_steps = num_steps;
  options.densify_until = 0.25;
  options.max_gaussians = 300;
  options.depth_weight = -1;
  options.refine_keep = RefineKeep::kShrink;
  options.min_loss_fall = options.min_band_gain = options.min_depth_agreement = 0;
  return options;
}

struct Trained {
  Gaussians gaussians;
  std::vector<SkippedPart> skipped;
  StepReport last;
};
Trained Train(const Capture& capture, const ReconstructOptions& options) {
  const auto backend = MakeCpuBackend(2);
  const auto trainer = GaussianTrainer::Create(*backend, capture, options).value();
  Trained out;
  while (!trainer->done()) {
    const auto report = trainer->Step();
    EXPECT_OK(report);
    out.last = report->back();
  }
  out.gaussians = trainer->Result();
  out.skipped = trainer->skipped();
  return out;
}

const SkippedPart* Find(const Trained& trained, Part part) {
  for (const SkippedPart& skipped : trained.skipped) {
    if (skipped.part == part && skipped.step > 0) return &skipped;
  }
  return nullptr;
}

double HeldOutPsnr(const Capture& capture, const Trained& trained) {
  const auto backend = MakeCpuBackend(2);
  return Mean(ScoreHeldOut(*backend, capture, trained.gaussians).value()).psnr;
}

TEST(SceneNeeds, SkipsAndReportsStepsAfterConvergence) {
  const Capture capture = Small();
  ReconstructOptions options = RunOf(4000);
  const Trained all = Train(capture, options);
  EXPECT_EQ(all.last.step, 4000);
  EXPECT_EQ(Find(all, Part::kSteps), nullptr);
  options.min_loss_fall = 0.2;
  const Trained fewer = Train(capture, options);
  const SkippedPart* steps = Find(fewer, Part::kSteps);
  ASSERT_NE(steps, nullptr);
  EXPECT_GE(steps->step, 1000);  // not before density control ends
  EXPECT_EQ(steps->step % Convergence::Window(5), 0);
  EXPECT_EQ(steps->saved_steps, 4000 - 800 - steps->step);
  EXPECT_EQ(fewer.last.step, 4000 - steps->saved_steps);
  EXPECT_EQ(fewer.last.num_steps, fewer.last.step);
  EXPECT_GT(HeldOutPsnr(capture, fewer), HeldOutPsnr(capture, all) - 0.5);
}

TEST(SceneNeeds, DropsAnUpsideDownDepthPrior) {
  Capture capture = Small(DepthPrior::Kind::kDisparity);
  ReconstructOptions options = RunOf(1500);
  options.min_depth_agreement = 0.5;
  EXPECT_EQ(Find(Train(capture, options), Part::kDepth), nullptr);
  for (View& view : capture.views) {
    for (float& value : view.depth.values) value = 1 - value;
  }
  const Trained trained = Train(capture, options);
  const SkippedPart* depth = Find(trained, Part::kDepth);
  ASSERT_NE(depth, nullptr);
  EXPECT_EQ(depth->step, 1000);  // the end of the second window
  EXPECT_TRUE(std::isnan(trained.last.depth_loss));
}

TEST(SceneNeeds, PrunesShDegreesThatGainNothing) {
  const Capture capture = Small();
  ReconstructOptions options = RunOf(1600);
  options.min_band_gain = 100;
  const Trained trained = Train(capture, options);
  ASSERT_NE(Find(trained, Part::kBands), nullptr);
  EXPECT_EQ(trained.gaussians.sh_degree, 0);
  options.min_band_gain = 1e-9;
  EXPECT_EQ(Train(capture, options).gaussians.sh_degree, 3);
}

// All three kinds of skipping occur in the run.
TEST(SceneNeeds, DecidesTheSameInAResumedRun) {
  Capture capture = Small(DepthPrior::Kind::kDisparity);
  for (View& view : capture.views) {
    for (float& value : view.depth.values) value = 1 - value;
  }
  ReconstructOptions options = RunOf(3000);
  options.min_loss_fall = 0.9;
  options.min_band_gain = 100;
  options.min_depth_agreement = 0.5;
  const Trained unbroken = Train(capture, options);
  for (const Part part : {Part::kDepth, Part::kBands, Part::kSteps}) {
    ASSERT_NE(Find(unbroken, part), nullptr) << NameOf(part);
  }
  const auto backend = MakeCpuBackend(1);
  const auto trainer = GaussianTrainer::Create(*backend, capture, options).value();
  int64_t step = 0;
  for (const int64_t broken_after : {499, 500, 731, 1000, 1003}) {
    for (; step < broken_after; ++step) ASSERT_OK(trainer->Step());
    ASSERT_OK_AND_ASSIGN(const GaussianCheckpoint checkpoint, trainer->Save());
    ASSERT_OK_AND_ASSIGN(const auto resumed,
                         GaussianTrainer::Resume(*backend, capture, options, checkpoint));
    while (!resumed->done()) ASSERT_OK(resumed->Step());
    EXPECT_EQ(resumed->Result().planes, unbroken.gaussians.planes) << "after " << broken_after;
  }
}

bool Window(DepthAgreement& agreement, int num_agreeing, int num_others) {
  for (int i = 0; i < num_agreeing; ++i) agreement.Add(0.7);
  for (int i = 0; i < num_others; ++i) agreement.Add(i % 2 == 0 ? 0.05 : -3.0);
  return agreement.Failed();
}

TEST(DepthAgreement, FailsAfterTwoWindowsWithTooFewAgreements) {
  DepthAgreement agreement(0.5);
  EXPECT_FALSE(Window(agreement, 4, 6));
  EXPECT_FALSE(Window(agreement, 5, 5));  // just enough
  EXPECT_FALSE(Window(agreement, 4, 6));
  EXPECT_TRUE(Window(agreement, 0, 10));
}

TEST(DepthAgreement, IgnoresWindowsWithoutComparisons) {
  DepthAgreement agreement(0.5);
  EXPECT_FALSE(Window(agreement, 0, 10));
  EXPECT_FALSE(Window(agreement, 0, 0));
  EXPECT_FALSE(Window(agreement, 0, 10));
}

TEST(DepthAgreement, NeverFailsWithAShareOfZero) {
  DepthAgreement agreement(0);
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(Window(agreement, 0, 10));
}

TEST(DepthAgreement, ResumesFromItsState) {
  DepthAgreement unbroken(0.5), resumed(0.5);
  EXPECT_FALSE(Window(unbroken, 0, 10));
  unbroken.Add(0);
  resumed.Restore(unbroken.state());
  EXPECT_TRUE(resumed.Failed());
}

const Capture& SmallSynthetic() {
  static const Capture capture =
      testing::MakeSyntheticScene({.width = 48, .height = 36, .num_points = 200}).capture;
  return capture;
}

// Returns Gaussians trained with degree 0 and stored with all degrees, the higher ones 0.
Gaussians Trained(Backend& backend) {
  ReconstructOptions options;
  options.num_steps = 150;
  options.sh_degree = 0;
  const Gaussians flat =
      testing::TrainGaussians(backend, SmallSynthetic(), options, [](const StepReport&) {
        return absl::OkStatus();
      }).value();
  Gaussians out = Gaussians::Zero(flat.count, kMaxShDegree);
  std::copy(flat.planes.begin(), flat.planes.end(), out.planes.begin());
  return out;
}

class ShPruningTest : public ::testing::Test {
 protected:
  int Sufficient(const Gaussians& gaussians, double min_gain) {
    const TrainingViews views(*backend_, SmallSynthetic(), {});
    GaussianState state(*backend_, gaussians);
    return SufficientShDegree(*backend_, views, 0.02f, state, min_gain);
  }

  const std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  Gaussians gaussians_ = Trained(*backend_);
};

TEST_F(ShPruningTest, RemovesDegreesWithoutCoefficients) {
  EXPECT_EQ(Sufficient(gaussians_, 0.1), 0);
}

// Makes a degree matter by moving part of the colour to it.
TEST_F(ShPruningTest, KeepsDegreesUpToTheLastThatMatters) {
  constexpr int kRedOfDegreeTwo = kShPlane + 3 * 6;
  const float y20_at_pole = 0.63f;
  for (int64_t i = 0; i < gaussians_.count; ++i) {
    gaussians_.Plane(kRedOfDegreeTwo)[i] = 0.8f;
    gaussians_.Plane(kShPlane)[i] -= 0.8f * y20_at_pole / 0.282f;
  }
  EXPECT_EQ(Sufficient(gaussians_, 0.1), 2);
}

TEST_F(ShPruningTest, DependsOnTheMinimumGain) {
  constexpr int kRedOfDegreeOne = kShPlane + 3 * 2;
  for (int64_t i = 0; i < gaussians_.count; ++i) {
    gaussians_.Plane(kRedOfDegreeOne)[i] = 0.3f;
    gaussians_.Plane(kShPlane)[i] -= 0.3f;
  }
  const int small_gain = Sufficient(gaussians_, 1e-6), large_gain = Sufficient(gaussians_, 100);
  EXPECT_EQ(large_gain, 0);
  EXPECT_EQ(small_gain, 1);
}

TEST(GaussianStateShDegree, StayRemovedInDownloadsAndCheckpoints) {
  const auto backend = MakeCpuBackend(1);
  Gaussians all = Gaussians::Zero(3, 2);
  for (size_t i = 0; i < all.planes.size(); ++i) all.planes[i] = static_cast<float>(i);
  GaussianState state(*backend, all);
  state.LimitShDegree(3);
  EXPECT_EQ(state.sh_degree(), 2);
  state.LimitShDegree(1);
  const auto num_left = static_cast<std::ptrdiff_t>(3 * NumPlanes(1));
  const std::vector<float> left(all.planes.begin(), all.planes.begin() + num_left);
  EXPECT_EQ(state.Download().sh_degree, 1);
  EXPECT_EQ(state.Download().planes, left);
  const std::vector<int32_t> source = {0, 1, 2};
  const std::vector<uint8_t> is_new = {0, 0, 0};
  ASSERT_TRUE(state.Rearrange({source.data(), 3}, {is_new.data(), 3}));
  EXPECT_EQ(state.Download().planes, left);
  GaussianState restored(*backend, all);
  ASSERT_TRUE(restored.Restore(state.DownloadRows()));
  EXPECT_EQ(restored.Download().planes, left);
}

}  // namespace
}  // namespace pepeseg
