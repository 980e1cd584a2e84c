#include "core/features/batch_source.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "tests/core/features/perception_scene.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr FeatureOptions kChunked = {.num_steps = 30, .num_pixels = 40, .steps_per_chunk = 7};

// The part of a step's input that is of its pixels.
struct Inputs {
  std::vector<int32_t> pixels, gaussians, columns;
  std::vector<float> alpha;
  friend bool operator==(const Inputs&, const Inputs&) = default;
};

template <class T>
std::vector<std::remove_const_t<T>> Copy(DeviceSpan<T> span) {
  return {span.data, span.data + span.size};
}

// With a twin: chunks are rasterised by it, ahead of their first step.
class BatchSourceTest : public ::testing::TestWithParam<bool> {
 protected:
  std::unique_ptr<BatchSource> MakeSource(bool with_twin) {
    return std::make_unique<BatchSource>(prepared_, kChunked,
                                         with_twin ? MakeCpuBackend(1) : nullptr);
  }
  std::unique_ptr<BatchSource> MakeSource() { return MakeSource(GetParam()); }

  // Takes the batches of the next steps. Returns what the steps read.
  static std::vector<Inputs> Take(BatchSource& source, int num_steps) {
    std::vector<Inputs> inputs;
    for (int i = 0; i < num_steps; ++i) {
      const auto steps = source.Next(/*most=*/1);
      EXPECT_OK(steps);
      if (!steps.ok()) break;
      const RowChunk::Step* step = &steps->front();
      const DeviceSpan<const int32_t> first = step->rows.first;
      inputs.push_back(
          {step->batch->pixels,
           Copy(step->rows.gaussian.Subspan(first[0], first[first.size - 1] - first[0])),
           Copy(step->columns.gaussian), Copy(step->alpha)});
    }
    return inputs;
  }

  testing::PerceptionScene scene_;
  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  PreparedFeatures prepared_ =
      PrepareFeatures(*backend_, scene_.scene.capture, scene_.gaussians, kChunked).value();
};

INSTANTIATE_TEST_SUITE_P(Twin, BatchSourceTest, ::testing::Bool(),
                         ::testing::PrintToStringParamName());

TEST_P(BatchSourceTest, ContinuesAfterAnyStep) {
  const auto all = Take(*MakeSource(/*with_twin=*/false), 30);
  EXPECT_EQ(Take(*MakeSource(), 30), all);
  // After 7 steps the chunk is used up; smoothing ends after 15, and with it a chunk of 1.
  for (const int num_done : {0, 3, 7, 8, 15, 16, 29}) {
    const auto first = MakeSource(), second = MakeSource();
    Take(*first, num_done);
    ASSERT_OK(second->Restore(first->chunk_start(), num_done, first->steps_of_chunk()));
    EXPECT_EQ(second->steps_of_chunk(), first->steps_of_chunk());
    const auto rest = Take(*second, 30 - num_done);
    EXPECT_TRUE(std::equal(rest.begin(), rest.end(), all.begin() + num_done)) << num_done;
  }
}

TEST_P(BatchSourceTest, KeepsTheBatchesBeforeThoseThatAreLeftOut) {
  const auto all = Take(*MakeSource(), 20);
  const auto shortened = MakeSource();
  Take(*shortened, 5);
  shortened->LeaveOutLast(10);
  const auto rest = Take(*shortened, 15);
  EXPECT_TRUE(std::equal(rest.begin(), rest.end(), all.begin() + 5));
}

TEST_P(BatchSourceTest, RefusesTheStateOfOtherViews) {
  const auto source = MakeSource();
  DrawerState state = source->chunk_start();
  state.views_left = {1000};
  EXPECT_STATUS(source->Restore(state, 0, 0), absl::StatusCode::kDataLoss, "views_left");
}

}  // namespace
}  // namespace pepeseg
