// Prompts by masks, and embeddings that segmenters give and take, on a backend's kernels.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "core/priors/sam/cpu_sam.h"
#include "tests/core/priors/sam/small_sam.h"
#include "tests/kernels/backend_test.h"

namespace pepeseg {
namespace {

class MaskPromptTest : public SmallSamTest {};
INSTANTIATE_TEST_SUITE_P(Backends, MaskPromptTest,
                         ::testing::Values(BackendCase{"Cpu", MakeTwoThreads},
                                           BackendCase{"Cuda", MakeCuda}),
                         BackendName);

struct LogitError {
  float error, largest;  // largest difference, and largest logit that is wanted
};
LogitError LargestError(const PromptAnswers& got, const PromptAnswers& want) {
  LogitError result = {0, 0};
  for (size_t i = 0; i < want.logits.size(); ++i) {
    result.largest = std::max(result.largest, std::abs(want.logits[i]));
    result.error = std::max(result.error, std::abs(want.logits[i] - got.logits[i]));
  }
  return result;
}

// Embeddings are rounded to Halves; on CUDA they are Halves.
TEST_P(MaskPromptTest, SegmentsByAnEmbeddingAsByItsPhotograph) {
  const View view = SmallView(200, 150, 1);
  const auto first = sam_->MakeSegmenter(), second = sam_->MakeSegmenter();
  ASSERT_OK(first->SetPhotograph(view.photo));
  ASSERT_OK_AND_ASSIGN(const SamEmbedding embedding, first->Embedding());
  EXPECT_EQ(embedding.width, 200);
  EXPECT_EQ(embedding.height, 150);
  ASSERT_EQ(std::ssize(embedding.values), SmallShape().embedding_size());
  // Another photograph first, so that the second segmenter has an embedding to replace.
  ASSERT_OK(second->SetPhotograph(SmallView(90, 160, 2).photo));
  ASSERT_OK(second->SetEmbedding(embedding));
  const MaskPrompt prompt = SmallMaskPrompt(view.photo, first->extent());
  ASSERT_OK_AND_ASSIGN(const PromptAnswers want, first->SegmentByMask(prompt));
  ASSERT_OK_AND_ASSIGN(const PromptAnswers got, second->SegmentByMask(prompt));
  ASSERT_EQ(want.ious.size(), 4U);
  ASSERT_EQ(want.logits.size(), size_t{4} * want.width * want.height);
  ASSERT_EQ(got.logits.size(), want.logits.size());
  const auto [error, largest] = LargestError(got, want);
  if (sam_->backend().memory().is_host) {
    EXPECT_LT(error, 0.01F * largest);
    EXPECT_GT(error, 0);
  } else {
    EXPECT_EQ(error, 0);
  }
}

TEST_P(MaskPromptTest, SegmentsByMasksAsTheCpuDoes) {
  const View view = SmallView(200, 150, 1);
  const auto cpu_sam = MakeSmallSam(MakeCpuBackend(1));
  const auto cpu = cpu_sam->MakeSegmenter(), other = sam_->MakeSegmenter();
  ASSERT_OK(cpu->SetPhotograph(view.photo));
  ASSERT_OK_AND_ASSIGN(const SamEmbedding embedding, cpu->Embedding());
  ASSERT_OK(cpu->SetEmbedding(embedding));
  ASSERT_OK(other->SetEmbedding(embedding));
  const MaskPrompt prompt = SmallMaskPrompt(view.photo, cpu->extent());
  ASSERT_OK_AND_ASSIGN(const PromptAnswers want, cpu->SegmentByMask(prompt));
  ASSERT_OK_AND_ASSIGN(const PromptAnswers got, other->SegmentByMask(prompt));
  ASSERT_EQ(got.logits.size(), want.logits.size());
  const auto [error, largest] = LargestError(got, want);
  EXPECT_LT(error, (sam_->backend().memory().is_host ? 1e-5F : 0.02F) * largest);
}

// Without a mask, the answer is that to a box alone.
TEST_P(MaskPromptTest, SegmentsByBoxesAsTheCpuDoes) {
  const View view = SmallView(200, 150, 1);
  const auto cpu_sam = MakeSmallSam(MakeCpuBackend(1));
  const auto cpu = cpu_sam->MakeSegmenter(), other = sam_->MakeSegmenter();
  ASSERT_OK(cpu->SetPhotograph(view.photo));
  ASSERT_OK_AND_ASSIGN(const SamEmbedding embedding, cpu->Embedding());
  ASSERT_OK(cpu->SetEmbedding(embedding));
  ASSERT_OK(other->SetEmbedding(embedding));
  const std::array<PromptPoint, 2> box = {PromptPoint{40, 30}, PromptPoint{120, 100}};
  ASSERT_OK_AND_ASSIGN(const PromptAnswers want, cpu->SegmentByMask({{}, box, {}}));
  ASSERT_OK_AND_ASSIGN(const PromptAnswers got, other->SegmentByMask({{}, box, {}}));
  ASSERT_EQ(got.logits.size(), want.logits.size());
  const auto [error, largest] = LargestError(got, want);
  EXPECT_LT(error, (sam_->backend().memory().is_host ? 1e-5F : 0.02F) * largest);
  // It is another one than to a mask that fills the box.
  MaskPrompt filled = {{}, box, std::vector<float>(size_t(cpu->extent()) * cpu->extent(), -10)};
  ASSERT_OK_AND_ASSIGN(const PromptAnswers masked, cpu->SegmentByMask(filled));
  EXPECT_GT(LargestError(masked, want).error, 0.01F * largest);
}

TEST_P(MaskPromptTest, RefusesAnEmbeddingOfAnotherSize) {
  const SamEmbedding embedding = {200, 150, std::vector<Half>(100)};
  const absl::Status status = sam_->MakeSegmenter()->SetEmbedding(embedding);
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
}

TEST(CpuSam, TakesNetworksForAnEmbedding) {
  const View view = SmallView(200, 150, 1);
  ASSERT_OK_AND_ASSIGN(const auto sam,
                       CpuSam::Make([]() -> absl::StatusOr<std::unique_ptr<DeviceSam>> {
                         return MakeSmallSam(MakeCpuBackend(1));
                       }));
  SamEmbedding embedding;
  {
    const auto segmenter = sam->MakeSegmenter();
    ASSERT_OK(segmenter->SetPhotograph(view.photo));
    ASSERT_OK_AND_ASSIGN(embedding, segmenter->Embedding());
  }
  const auto segmenter = sam->MakeSegmenter();
  ASSERT_OK(segmenter->SetEmbedding(embedding));
  EXPECT_OK(segmenter->SegmentByMask(SmallMaskPrompt(view.photo, segmenter->extent())));
}

}  // namespace
}  // namespace pepeseg
