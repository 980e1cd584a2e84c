#include "core/priors/sam/fallback_segmenter.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// Records its calls, and fails from one on.
class RecordingSegmenter : public PromptedSegmenter {
 public:
  RecordingSegmenter(std::vector<std::string>& calls, std::string name, absl::Status failure = {},
                     int first_failure = 0)
      : calls_(calls),
        name_(std::move(name)),
        failure_(std::move(failure)),
        calls_left_(first_failure) {}

  absl::Status SetPhotograph(const Image& photo) override {
    return Call("photograph " + std::to_string(photo.width));
  }
  absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt>) override {
    const absl::Status status = Call("segment");
    if (!status.ok()) return status;
    return PromptAnswers();
  }
  absl::StatusOr<SamEmbedding> Embedding() override {
    const absl::Status status = Call("give embedding");
    if (!status.ok()) return status;
    return SamEmbedding();
  }
  absl::Status SetEmbedding(const SamEmbedding& embedding) override {
    return Call("embedding " + std::to_string(embedding.width));
  }
  absl::StatusOr<PromptAnswers> SegmentByMask(const MaskPrompt&) override {
    const absl::Status status = Call("segment by mask");
    if (!status.ok()) return status;
    return PromptAnswers();
  }

 private:
  absl::Status Call(const std::string& call) {
    if (calls_left_-- <= 0 && !failure_.ok()) return failure_;
    calls_.push_back(name_ + ": " + call);
    return absl::OkStatus();
  }
  std::vector<std::string>& calls_;
  const std::string name_;
  const absl::Status failure_;
  int calls_left_;
};

struct FallbackTest : ::testing::Test {
  // A segmenter whose first fails after some calls.
  FallbackSegmenter Make(const absl::Status& failure, int first_failure) {
    return {
        std::make_unique<RecordingSegmenter>(calls, "GPU", failure, first_failure),
        [this](const absl::Status& status) -> absl::StatusOr<std::unique_ptr<PromptedSegmenter>> {
          why = status;
          if (!other_fails.ok()) return other_fails;
          return std::make_unique<RecordingSegmenter>(calls, "CPU");
        }};
  }

  std::vector<std::string> calls;
  absl::Status why, other_fails;
  const Image photo{7, 5, 3, {}};
  const std::vector<SegmenterPrompt> prompts = {{PromptPoint{}}};
};

TEST_F(FallbackTest, RepeatsACallThatFoundNoMemory) {
  const absl::Status failure = absl::ResourceExhaustedError("out of memory");
  FallbackSegmenter segmenter = Make(failure, 2);
  EXPECT_OK(segmenter.SetPhotograph(photo));
  for (int i = 0; i < 3; ++i) EXPECT_OK(segmenter.Segment(prompts));
  EXPECT_EQ(calls, (std::vector<std::string>{"GPU: photograph 7", "GPU: segment",
                                             "CPU: photograph 7", "CPU: segment", "CPU: segment"}));
  EXPECT_EQ(why, failure);
}

TEST_F(FallbackTest, GivesThePhotographToTheOtherOnce) {
  FallbackSegmenter segmenter = Make(absl::InternalError("an illegal address"), 0);
  EXPECT_OK(segmenter.SetPhotograph(photo));
  EXPECT_OK(segmenter.Propose({}, [] { return absl::OkStatus(); }));
  EXPECT_EQ(calls, (std::vector<std::string>{"CPU: photograph 7"}));
}

TEST_F(FallbackTest, GivesTheEmbeddingToTheOther) {
  FallbackSegmenter segmenter = Make(absl::ResourceExhaustedError("out of memory"), 2);
  const SamEmbedding embedding = {9, 5, {}};
  EXPECT_OK(segmenter.SetPhotograph(photo));
  EXPECT_OK(segmenter.SetEmbedding(embedding));
  EXPECT_OK(segmenter.SegmentByMask({}));
  EXPECT_OK(segmenter.Embedding());
  EXPECT_EQ(calls,
            (std::vector<std::string>{"GPU: photograph 7", "GPU: embedding 9", "CPU: embedding 9",
                                      "CPU: segment by mask", "CPU: give embedding"}));
}

TEST_F(FallbackTest, ReturnsOtherErrors) {
  FallbackSegmenter segmenter = Make(absl::CancelledError("interrupted"), 1);
  EXPECT_OK(segmenter.SetPhotograph(photo));
  EXPECT_TRUE(absl::IsCancelled(segmenter.Segment(prompts).status()));
  EXPECT_OK(why);
}

TEST_F(FallbackTest, ReturnsTheErrorOfOpeningTheOther) {
  other_fails = absl::FailedPreconditionError("no library");
  FallbackSegmenter segmenter = Make(absl::ResourceExhaustedError("out of memory"), 1);
  EXPECT_OK(segmenter.SetPhotograph(photo));
  EXPECT_EQ(segmenter.Segment(prompts).status(), other_fails);
}

}  // namespace
}  // namespace pepeseg
