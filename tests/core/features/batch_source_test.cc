#include "core/features/batch_source.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "tests/core/features/perception_scene.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr FeatureOptions kChunked = {.num_steps = 30, .num_pixels = 40, .steps_per_chunk = 7};

class BatchSourceTest : public ::testing::Test {
 protected:
  // Takes the batches of the next steps. Returns their pixels.
  static std::vector<std::vector<int32_t>> Take(BatchSource& source, int num_steps) {
    std::vector<std::vector<int32_t>> pixels;
    for (int i = 0; i < num_steps; ++i) {
      const auto step = source.Next();
      EXPECT_OK(step);
      if (!step.ok()) break;
      pixels.push_back(step->batch->pixels);
    }
    return pixels;
  }

  testing::PerceptionScene scene_;
  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  PreparedFeatures prepared_ =
      PrepareFeatures(*backend_, scene_.scene.capture, scene_.gaussians, kChunked).value();
};

TEST_F(BatchSourceTest, ContinuesAfterAnyStep) {
  BatchSource unbroken(prepared_, kChunked);
  const auto all = Take(unbroken, 30);
  // After 7 steps the chunk is used up; smoothing ends after 15, and with it a chunk of 1.
  for (const int num_done : {0, 3, 7, 8, 15, 16, 29}) {
    BatchSource first(prepared_, kChunked);
    Take(first, num_done);
    BatchSource second(prepared_, kChunked);
    ASSERT_OK(second.Restore(first.chunk_start(), num_done, first.steps_of_chunk()));
    EXPECT_EQ(second.steps_of_chunk(), first.steps_of_chunk());
    const auto rest = Take(second, 30 - num_done);
    EXPECT_TRUE(std::equal(rest.begin(), rest.end(), all.begin() + num_done)) << num_done;
  }
}

TEST_F(BatchSourceTest, KeepsTheBatchesBeforeThoseThatAreLeftOut) {
  BatchSource unbroken(prepared_, kChunked);
  const auto all = Take(unbroken, 20);
  BatchSource shortened(prepared_, kChunked);
  Take(shortened, 5);
  shortened.LeaveOutLast(10);
  const auto rest = Take(shortened, 15);
  EXPECT_TRUE(std::equal(rest.begin(), rest.end(), all.begin() + 5));
}

TEST_F(BatchSourceTest, RefusesTheStateOfOtherViews) {
  BatchSource source(prepared_, kChunked);
  DrawerState state = source.chunk_start();
  state.views_left = {1000};
  EXPECT_STATUS(source.Restore(state, 0, 0), absl::StatusCode::kDataLoss, "views_left");
}

}  // namespace
}  // namespace pepeseg
