#include "core/features/estimate.h"

#include "tests/core/features/perception_scene.h"
#include "tests/testing/point_gaussians.h"
#include "tests/testing/run_trainers.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

constexpr int64_t kNumPixels = 96 * 72, kNumTiles = 6 * 5;  // of a view of SyntheticCapture

Capture SyntheticCapture() {
  Capture capture =
      testing::MakeSyntheticScene({.num_points = 4000, .depth = DepthPrior::Kind::kDisparity})
          .capture;
  testing::DropMasks(capture);
  return capture;
}

// Trains, and compares the estimate with the memory that was in use. num_entries: of a render, as
// stage one estimates it.
void ExpectBounds(const Capture& capture, const Gaussians& gaussians, int64_t num_entries,
                  const FeatureOptions& options) {
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK(testing::TrainFeatures(*backend, capture, gaussians, options,
                                   [](const StepReport&) { return absl::OkStatus(); }));
  const ScratchSize scratch = {gaussians.count, num_entries, kNumTiles, kNumPixels};
  const auto bound =
      static_cast<double>(FeatureDeviceBytes(*backend, scratch, gaussians.sh_degree, options));
  const auto peak = static_cast<double>(backend->peak_bytes_in_use());
  ::testing::Test::RecordProperty("ratio", std::to_string(bound / peak));
  EXPECT_GE(bound, peak);
  EXPECT_LE(bound, 2.5 * peak);
}

TEST(EstimateFeatures, BoundsTheMemoryOfATrainingWithinAFactorOfTwoAndAHalf) {
  const Capture capture = SyntheticCapture();
  // Wide enough for blend rows about as long as the estimate assumes.
  const Gaussians gaussians = testing::PointGaussians(capture, 0.1f);
  for (const int steps_per_chunk : {5, 40}) {
    FeatureOptions options;
    options.num_steps = 40;
    options.num_pixels = 200;
    options.steps_per_chunk = steps_per_chunk;
    ExpectBounds(capture, gaussians, 12 * gaussians.count, options);
  }
}

// Few samples, and Gaussians that most tiles show: the preparation takes more than the training.
TEST(EstimateFeatures, BoundsTheMemoryOfThePreparationWithinAFactorOfTwoAndAHalf) {
  const Capture capture = SyntheticCapture();
  const Gaussians gaussians = testing::PointGaussians(capture, 0.6f);
  FeatureOptions options;
  options.num_steps = 4;
  options.num_pixels = options.num_background_pixels = options.num_perception_pixels = 8;
  options.steps_per_chunk = 1;
  ExpectBounds(capture, gaussians, kNumTiles * gaussians.count, options);
}

}  // namespace
}  // namespace pepeseg
