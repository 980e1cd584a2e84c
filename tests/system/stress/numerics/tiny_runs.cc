#include "tests/system/stress/numerics/tiny_runs.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "core/base/status_macros.h"
#include "core/evaluate/evaluate.h"
#include "core/evaluate/image_scores.h"
#include "core/features/trainer.h"
#include "core/reconstruct/initial_gaussians.h"
#include "core/reconstruct/trainer.h"

namespace pepeseg::testing {
namespace {

bool AllFinite(std::span<const float> values) {
  return std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
}

void ExpectSoundRows(const GaussianRows& rows, StageOneRun& run) {
  EXPECT_TRUE(AllFinite(rows.parameters));
  EXPECT_TRUE(AllFinite(rows.moment1));
  EXPECT_TRUE(AllFinite(rows.moment2));
  EXPECT_TRUE(AllFinite(rows.grad_sum));
  EXPECT_TRUE(AllFinite(rows.square_sum));
  EXPECT_TRUE(std::ranges::all_of(rows.moment2, [](float value) { return value >= 0; }));
  for (const float value : rows.moment1) {
    run.largest_moment1 = std::max(run.largest_moment1, std::abs(value));
  }
  for (const float value : rows.moment2) run.largest_moment2 = std::max(run.largest_moment2, value);
  for (const int32_t steps : rows.num_steps) {
    EXPECT_GE(steps, 0);
    run.most_steps = std::max(run.most_steps, steps);
  }
}

void ExpectLogScalesWithinBounds(const Capture& capture, const ReconstructOptions& options,
                                 const Gaussians& gaussians) {
  std::mt19937_64 random(options.seed);
  const LogScaleBounds bounds = BoundLogScales(capture, StartingPoints(capture, options, random));
  EXPECT_LT(bounds.min, bounds.max);
  for (int plane = kLogScalePlane; plane < kLogScalePlane + 3; ++plane) {
    const auto [least, most] = std::ranges::minmax(gaussians.Plane(plane));
    EXPECT_GE(least, bounds.min);
    EXPECT_LE(most, bounds.max);
  }
}

bool HasHeldOut(const Capture& capture) {
  return std::ranges::any_of(capture.views, [](const View& view) { return view.held_out; });
}

void ExpectUnitRows(const FeatureField& field) {
  for (size_t row = 0; row < field.features.size(); row += kFeatureSize) {
    double squares = 0;
    for (int k = 0; k < kFeatureSize; ++k) squares += std::pow(field.features[row + k], 2);
    EXPECT_TRUE(squares == 0 || std::abs(squares - 1) < 1e-5) << squares;
  }
}

double MeanOf(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) /
         static_cast<double>(std::max<size_t>(1, values.size()));
}

size_t CountOf(const std::vector<double>& values, double share) {
  return std::max<size_t>(1, static_cast<size_t>(share * static_cast<double>(values.size())));
}

}  // namespace

SyntheticScene TinyScene(const TinyOptions& options) {
  return MakeSyntheticScene({.num_views = options.num_views,
                             .width = options.side,
                             .height = options.side,
                             .held_out_every = options.held_out_every,
                             .num_points = options.num_points,
                             .depth = options.depth});
}

ReconstructOptions TinyReconstruct(int num_steps) {
  ReconstructOptions options;
  options.num_steps = num_steps;
  options.densify_every = std::max(20, num_steps / 100);
  options.max_gaussians = 400;
  options.pixels_per_gaussian = 10;
  options.min_loss_fall = 0;
  options.views_at_once = 1;  // on all devices, so that what was measured holds for each of them
  // Parts that are off by default.
  options.depth_weight = -1;
  options.refine_keep = RefineKeep::kShrink;
  return options;
}

FeatureOptions TinyFeatures(int num_steps) {
  return {.num_steps = num_steps,
          .num_pixels = 64,
          .num_background_pixels = 8,
          .num_scales = 4,
          .centroid_every = std::max(50, num_steps / 10),
          .centroid_pixels = 512,
          .num_perception_pixels = 16,
          .steps_per_chunk = 250,
          .min_loss_fall = 0};
}

absl::StatusOr<StageOneRun> RunStageOne(Backend& backend, const Capture& capture,
                                        const ReconstructOptions& options) {
  ASSIGN_OR_RETURN(const auto stage, GaussianTrainer::Create(backend, capture, options));
  StageOneRun run;
  int num_unmeasured = 0;  // steps before the first result of the device was read
  while (!stage->done()) {
    ASSIGN_OR_RETURN(const StepReports reports, stage->Step());
    run.last = reports.back();
    if (run.losses.empty() && std::isnan(run.last.loss)) {
      ++num_unmeasured;
    } else {
      run.losses.push_back(run.last.loss);
    }
  }
  EXPECT_LE(num_unmeasured, backend.queue_depth());
  EXPECT_TRUE(std::ranges::all_of(run.losses, [](double loss) { return std::isfinite(loss); }));
  EXPECT_EQ(run.last.num_skipped_gradients, 0);
  EXPECT_EQ(run.last.num_culled_degenerate, 0);
  ASSIGN_OR_RETURN(const GaussianCheckpoint checkpoint, stage->Save());
  ExpectSoundRows(checkpoint.gaussians, run);
  ExpectLogScalesWithinBounds(capture, options, stage->Result());
  run.gaussians = stage->Result();
  run.skipped = stage->skipped();
  if (!HasHeldOut(capture)) return run;
  ASSIGN_OR_RETURN(const std::vector<ViewScores> scores,
                   ScoreHeldOut(backend, capture, run.gaussians));
  run.psnr = Mean(scores).psnr;
  EXPECT_TRUE(std::isfinite(run.psnr));
  return run;
}

absl::StatusOr<StageTwoRun> RunStageTwo(Backend& backend, const Capture& capture,
                                        const Gaussians& gaussians, const FeatureOptions& options) {
  ASSIGN_OR_RETURN(const auto stage, FeatureTrainer::Create(backend, capture, gaussians, options));
  StageTwoRun run;
  while (!stage->done()) {
    ASSIGN_OR_RETURN(const StepReports reports, stage->Step());
    for (const StepReport& report : reports) run.losses.push_back(report.loss);
  }
  run.field = stage->Result();
  EXPECT_TRUE(std::ranges::all_of(run.losses, [](double loss) { return std::isfinite(loss); }));
  EXPECT_TRUE(AllFinite(run.field.features));
  EXPECT_TRUE(AllFinite(run.field.gate));
  EXPECT_TRUE(AllFinite(run.field.scale_quantiles));
  ExpectUnitRows(run.field);
  return run;
}

double MeanOfFirst(const std::vector<double>& values, double share) {
  return MeanOf(std::span(values).first(CountOf(values, share)));
}

double MeanOfLast(const std::vector<double>& values, double share) {
  return MeanOf(std::span(values).last(CountOf(values, share)));
}

double MedianOfLast(const std::vector<double>& values, double share) {
  const auto last = std::span(values).last(CountOf(values, share));
  std::vector<double> sorted(last.begin(), last.end());
  std::ranges::sort(sorted);
  return sorted[sorted.size() / 2];
}

absl::StatusOr<double> ClickIou(Backend& backend, const SyntheticScene& scene,
                                const Gaussians& gaussians, const FeatureField& field) {
  Model model;
  model.gaussians = gaussians;
  model.field = field;
  model.scene_radius = SceneRadius(scene.capture);
  EvaluationRequest request;
  for (size_t i = 0; i < scene.capture.views.size(); ++i) {
    const View& view = scene.capture.views[i];
    model.views.push_back({view.name, view.camera, view.cam_from_world, view.held_out});
    if (!view.held_out) continue;
    const std::vector<uint8_t>& labels = scene.labels[i];
    TruthViewBuilder builder(model.views.back());
    RETURN_IF_ERROR(builder.AddLabels(std::vector<uint16_t>(labels.begin(), labels.end()), {}));
    request.views.push_back(std::move(builder).Build());
  }
  ASSIGN_OR_RETURN(const auto segmenter, Segmenter::Create(backend, std::move(model)));
  EvaluationOptions options;
  options.task.min_pixels = 12;
  ASSIGN_OR_RETURN(const EvaluationResult scores, Evaluate(*segmenter, std::move(request), options,
                                                           [] { return absl::OkStatus(); }));
  return scores.scene.reference_choice.value_or(MaskScores()).iou;
}

std::unique_ptr<Backend> MakeCpu() { return MakeCpuBackend(2); }

}  // namespace pepeseg::testing
