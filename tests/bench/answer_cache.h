#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "core/priors/sam/prompted_segmenter.h"

namespace pepeseg {

// Caches the answers of a prompted segmenter: runs each prompt on a photograph once, and measures
// the processor time that it takes.
class AnswerCache : public PromptedSegmenter {
 public:
  explicit AnswerCache(std::unique_ptr<PromptedSegmenter> segmenter);

  // Keeps the cached answers if `photo` is the same photograph as before.
  absl::Status SetPhotograph(const Image& photo) override;
  absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) override;

  double seconds_per_photograph() const;
  double seconds_per_prompt() const;

 private:
  using Key = std::vector<float>;
  struct Answer {
    std::vector<int8_t> tenths;  // logits, in tenths
    std::vector<float> ious;
  };

  std::unique_ptr<PromptedSegmenter> segmenter_;
  const uint8_t* photo_ = nullptr;
  PromptAnswers grid_;
  std::map<Key, Answer> answers_;
  double photo_seconds_ = 0, prompt_seconds_ = 0;
  int64_t num_photos_ = 0, num_prompts_ = 0;
};

}  // namespace pepeseg
