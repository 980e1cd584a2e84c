#include "core/reconstruct/estimate.h"

#include <cmath>

#include "core/reconstruct/trainer.h"
#include "tests/testing/run_trainers.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

constexpr double kLoosest = 1.6;

struct Case {
  const char* name;
  int width, height;
  int64_t max_gaussians;
  int sh_degree;
  double coarse_until, densify_until;
  double pixels_per_gaussian;
  double megapixels_per_step = 0;
};

class EstimateTest : public ::testing::TestWithParam<Case> {};

// Compares with the peak, which includes the temporary memory of density control.
TEST_P(EstimateTest, IsATightUpperBoundOfATraining) {
  const Case& c = GetParam();
  testing::SyntheticOptions scene;
  scene.width = c.width;
  scene.height = c.height;
  const Capture capture = testing::MakeSyntheticScene(scene).capture;
  ReconstructOptions options;
  options.num_steps = 120;
  options.densify_from = 0.1;
  options.densify_until = c.densify_until;
  options.densify_every = 20;
  options.densify_gradient = 1e-6f;  // densifies up to max_gaussians
  options.sh_degree = c.sh_degree;
  options.coarse_until = c.coarse_until;
  options.max_gaussians = c.max_gaussians;
  options.pixels_per_gaussian = c.pixels_per_gaussian;
  options.megapixels_per_step = c.megapixels_per_step;
  options.full_size_visits = 0;
  options.refine_keep = RefineKeep::kShrink;
  options.dropout = 0;  // the estimate counts what a step without it renders
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const Gaussians result,
                       testing::TrainGaussians(*backend, capture, options,
                                               [](const StepReport&) { return absl::OkStatus(); }));
  const TrainingSize size = SizeOf(capture);
  EXPECT_GE(result.count, MostGaussians(size, options) * 9 / 10);
  const MemoryNeed need = EstimateReconstruct(*backend, size, options);
  const auto peak = static_cast<double>(backend->peak_bytes_in_use());
  RecordProperty("ratio", std::to_string(static_cast<double>(need.device_bytes) / peak));
  EXPECT_GE(static_cast<double>(need.device_bytes), peak);
  EXPECT_LE(static_cast<double>(need.device_bytes), kLoosest * peak);
  EXPECT_GE(need.host_bytes, CaptureBytes(size));
}

INSTANTIATE_TEST_SUITE_P(Sizes, EstimateTest,
                         ::testing::Values(Case{"small", 96, 72, 1500, 3, 0, 0.9, 0},
                                           Case{"many", 96, 72, 6000, 2, 0, 0.9, 0},
                                           Case{"coarse", 192, 144, 5000, 3, 0.5, 0.9, 0},
                                           Case{"fixed", 192, 144, 1'000'000, 1, 0, 0, 50},
                                           Case{"budgeted", 192, 144, 1'000'000, 3, 0, 0.85, 50},
                                           Case{"shrunk", 384, 288, 3000, 3, 0, 0.85, 50, 0.03}),
                         [](const auto& info) { return std::string(info.param.name); });

TEST(Estimate, GrowsWithWhatItDependsOn) {
  const auto backend = MakeCpuBackend(1);
  const TrainingSize size = {10, 8, 10 * 300'000, 300'000, 5000, 0, 0, 0};
  ReconstructOptions options;
  options.pixels_per_gaussian = 0;
  options.refine_keep = RefineKeep::kShrink;
  const MemoryNeed base = EstimateReconstruct(*backend, size, options);
  const auto grows = [&](const TrainingSize& other, const ReconstructOptions& other_options) {
    const MemoryNeed need = EstimateReconstruct(*backend, other, other_options);
    return need.device_bytes > base.device_bytes || need.host_bytes > base.host_bytes;
  };
  ReconstructOptions more = options;
  more.max_gaussians *= 2;
  EXPECT_TRUE(grows(size, more));
  more = options;
  more.coarse_until = 0.5;
  EXPECT_TRUE(grows(size, more));
  // Steps that render a tenth of the pixels: photographs at half and a quarter of their size, too.
  more = options;
  more.megapixels_per_step = 0.03;
  more.full_size_visits = 0;
  EXPECT_TRUE(grows(size, more));
  for (int64_t TrainingSize::*field :
       {&TrainingSize::num_training_views, &TrainingSize::num_pixels, &TrainingSize::max_pixels,
        &TrainingSize::num_masked_views, &TrainingSize::num_ignore_views,
        &TrainingSize::num_depth_views}) {
    TrainingSize larger = size;
    larger.*field += larger.*field / 2 + 1;
    EXPECT_TRUE(grows(larger, options));
  }
}

TEST(Estimate, MovesPhotographsToTheHost) {
  const auto backend = MakeCpuBackend(1);
  const TrainingSize size = {10, 8, 10 * 300'000, 300'000, 5000, 6, 0, 0};
  ReconstructOptions options;
  options.refine_keep = RefineKeep::kShrink;
  const MemoryNeed need = EstimateReconstruct(*backend, size, options);
  // RGB of 8 bits of the training views, and masks of 32 bits of six of them.
  const int64_t movable = (8 * 3 + 6 * 4) * int64_t{300'000};
  EXPECT_EQ(need.movable_bytes, movable);
  options.photographs_on_host = true;
  const MemoryNeed moved = EstimateReconstruct(*backend, size, options);
  EXPECT_EQ(moved.device_bytes, need.device_bytes - movable);
  EXPECT_EQ(moved.host_bytes, need.host_bytes + movable);
  EXPECT_EQ(PhotographPlace(*backend, size, options), MemoryPlace::kHost);
  options.photographs_on_host = false;
  EXPECT_EQ(PhotographPlace(*backend, size, options), MemoryPlace::kDevice);
}

// Photographs seen smaller have fewer Gaussians, as WithPixelBudget has it.
TEST(Estimate, CountsTheGaussiansOfTheLimitOnPixels) {
  const TrainingSize size = {10, 8, 10 * 300'000, 300'000, 500, 0, 0, 0};
  ReconstructOptions options;
  options.full_size_visits = 0;
  options.megapixels_per_step = 0;
  EXPECT_EQ(MostGaussians(size, options), 8 * 300'000 / 50);
  options.megapixels_per_step = 0.001;  // coarse_until 0.95
  EXPECT_NEAR(static_cast<double>(MostGaussians(size, options)),
              8 * 300'000 / (50 * std::pow(4, 0.95)), 1);
}

}  // namespace
}  // namespace pepeseg
