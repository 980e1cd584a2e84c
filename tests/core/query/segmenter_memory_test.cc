// Makes every allocation of a query fail once. That query must return an error, and later queries
// on this model and on others of the same backend must give the same results as before.
#include <gtest/gtest.h>

#include <memory>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/query/resolve_prompt.h"
#include "core/query/segmenter.h"
#include "tests/testing/failing_allocations.h"
#include "tests/testing/front_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kSize = 48;

struct Answers {
  std::vector<uint8_t> mask;
  std::vector<float> similarity, depth;
  std::vector<uint8_t> color, left_only, features;
  std::vector<int32_t> ids, levels;

  bool operator==(const Answers&) const = default;
};

absl::StatusOr<Answers> AskMask(const Segmenter& segmenter) {
  const ModelView& view = segmenter.model().views[0];
  const std::vector<PointPrompt> points = {{17.5, 24.5, true}};
  ASSIGN_OR_RETURN(const Query query, ResolvePrompt(segmenter, {view, points}, {}));
  ASSIGN_OR_RETURN(
      const auto results,
      segmenter.Segment(query, {&view, 1}, {.want_similarity = true, .refine_borders = true}));
  Answers answers;
  answers.mask = results[0].mask.pixels;
  answers.similarity = results[0].similarity;
  return answers;
}

// Calls everything in a segmenter that computes on the backend.
absl::StatusOr<Answers> AskEverything(const Segmenter& segmenter) {
  const ModelView& view = segmenter.model().views[0];
  const GaussianSet left = {{1, 0}};
  const std::vector<int32_t> ids = {1, 2};
  const std::vector<double> scales = {0.5};
  // A subset first: Gaussians that it hides must show again even if memory ran out in between.
  ASSIGN_OR_RETURN(const Image left_only, segmenter.RenderColor(view, &left));
  ASSIGN_OR_RETURN(Answers answers, AskMask(segmenter));
  ASSIGN_OR_RETURN(const Image color, segmenter.RenderColor(view));
  ASSIGN_OR_RETURN(const Image features, segmenter.RenderFeatures(view, 0.5, &left));
  ASSIGN_OR_RETURN(answers.depth, segmenter.RenderDepth(view));
  ASSIGN_OR_RETURN(answers.ids, segmenter.RenderIds(view, ids));
  RETURN_IF_ERROR(segmenter.WithDecomposition(scales, [&](const Decomposition& whole) {
    answers.levels = whole.levels[0].ids;
    return absl::OkStatus();
  }));
  answers.color = color.pixels;
  answers.left_only = left_only.pixels;
  answers.features = features.pixels;
  return answers;
}

absl::StatusOr<std::unique_ptr<Segmenter>> MakeSegmenter(Backend& backend) {
  return Segmenter::Create(backend, testing::PairOfBlobs(kSize));
}

// Calls `ask` with 0, 1, 2 ... allocations allowed until they suffice, and `check` after each
// failure.
template <typename Ask, typename Check>
void FailEachAllocation(int at_least, Ask ask, Check check) {
  for (int allowed = 0;; ++allowed) {
    SCOPED_TRACE(allowed);
    ASSERT_LT(allowed, 1000) << "the last allocation was never reached";
    allocations_left = allowed;
    const absl::Status status = ask();
    const bool was_enough = allocations_left > 0;
    allocations_left = kUnlimited;
    if (status.ok()) {
      if (!was_enough) continue;  // the last one was just served
      EXPECT_GE(allowed, at_least);
      return;
    }
    EXPECT_STATUS(status, absl::StatusCode::kResourceExhausted, "memory");
    check();
  }
}

TEST(SegmenterMemory, FailsOnlyTheQueryThatLacksMemory) {
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const auto neighbour, MakeSegmenter(*backend));
  ASSERT_OK_AND_ASSIGN(const Answers want, AskEverything(*neighbour));
  std::unique_ptr<Segmenter> segmenter;
  int num_failed = 0;
  FailEachAllocation(
      30,
      [&]() -> absl::Status {
        // Those of the model itself are another test's.
        const int allowed = std::exchange(allocations_left, kUnlimited);
        auto made = MakeSegmenter(*backend);
        allocations_left = allowed;
        RETURN_IF_ERROR(made.status());
        segmenter = *std::move(made);
        return AskEverything(*segmenter).status();
      },
      [&] {
        ++num_failed;
        EXPECT_EQ(backend->error(), "");
        ASSERT_OK_AND_ASSIGN(const Answers of_neighbour, AskMask(*neighbour));
        EXPECT_EQ(of_neighbour.mask, want.mask);
        ASSERT_OK_AND_ASSIGN(const Answers mask_first, AskMask(*segmenter));
        EXPECT_EQ(mask_first.mask, want.mask);
        EXPECT_EQ(mask_first.similarity, want.similarity);
        ASSERT_OK_AND_ASSIGN(const Answers again, AskEverything(*segmenter));
        EXPECT_TRUE(again == want);
      });
  EXPECT_GE(num_failed, 30);
}

TEST(SegmenterMemory, RefusesAModelThatDoesNotFit) {
  const auto backend = MakeCpuBackend(1);
  ASSERT_OK_AND_ASSIGN(const auto neighbour, MakeSegmenter(*backend));
  ASSERT_OK_AND_ASSIGN(const Answers want, AskMask(*neighbour));
  const size_t before = backend->bytes_in_use();
  FailEachAllocation(
      3, [&] { return MakeSegmenter(*backend).status(); },
      [&] {
        EXPECT_EQ(backend->bytes_in_use(), before);
        ASSERT_OK_AND_ASSIGN(const Answers answers, AskMask(*neighbour));
        EXPECT_EQ(answers.mask, want.mask);
      });
}

}  // namespace
}  // namespace pepeseg
