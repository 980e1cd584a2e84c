#include "core/reconstruct/sh_pruning.h"

#include "core/reconstruct/initial_gaussians.h"
#include "core/reconstruct/reconstructor.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/synthetic_capture.h"

namespace pepeseg {
namespace {

const Capture& Synthetic() {
  static const Capture capture =
      testing::MakeSyntheticScene({.width = 48, .height = 36, .num_points = 200}).capture;
  return capture;
}

// Returns Gaussians trained with degree 0 and stored with all degrees, the higher ones 0.
Gaussians Trained(Backend& backend) {
  ReconstructOptions options;
  options.num_steps = 150;
  options.sh_degree = 0;
  const Gaussians flat = Reconstruct(backend, Synthetic(), options, [](const StepReport&) {
                           return absl::OkStatus();
                         }).value();
  Gaussians out = Gaussians::Zero(flat.count, kMaxShDegree);
  std::copy(flat.planes.begin(), flat.planes.end(), out.planes.begin());
  return out;
}

class ShPruningTest : public ::testing::Test {
 protected:
  int Sufficient(const Gaussians& gaussians, double min_gain) {
    const TrainingViews views(*backend_, Synthetic(), {});
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
