#include "core/features/estimate.h"

#include "tests/core/features/perception_scene.h"
#include "tests/testing/point_gaussians.h"
#include "tests/testing/run_trainers.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

TEST(EstimateFeatures, BoundsTheMemoryOfATrainingWithinAFactorOfTwoAndAHalf) {
  Capture capture =
      testing::MakeSyntheticScene({.num_points = 4000, .depth = DepthPrior::Kind::kDisparity})
          .capture;
  testing::DropMasks(capture);
  // Wide enough for blend rows about as long as the estimate assumes.
  const Gaussians gaussians = testing::PointGaussians(capture, 0.1f);
  for (const int steps_per_chunk : {5, 40}) {
    FeatureOptions options;
    options.num_steps = 40;
    options.num_pixels = 200;
    options.steps_per_chunk = steps_per_chunk;
    const auto backend = MakeCpuBackend(2);
    ASSERT_OK(testing::TrainFeatures(*backend, capture, gaussians, options,
                                     [](const StepReport&) { return absl::OkStatus(); }));
    // The sizes of a render, which stage one estimates: here those of this capture.
    const int64_t num_pixels = 96 * 72, num_tiles = 6 * 5;
    const ScratchSize scratch = {gaussians.count, 12 * gaussians.count, num_tiles, num_pixels};
    const auto bound =
        static_cast<double>(FeatureDeviceBytes(*backend, scratch, gaussians.sh_degree, options));
    const auto peak = static_cast<double>(backend->peak_bytes_in_use());
    RecordProperty("ratio", std::to_string(bound / peak));
    EXPECT_GE(bound, peak);
    EXPECT_LE(bound, 2.5 * peak);
  }
}

}  // namespace
}  // namespace pepeseg
