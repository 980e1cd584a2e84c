#include "tests/bench/answer_cache.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <utility>

#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

double ProcessorSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::vector<float> KeyOf(const SegmenterPrompt& prompt) {
  std::vector<float> key;
  for (const PromptPoint& point : prompt) {
    key.insert(key.end(), {point.x, point.y, point.positive ? 1.0F : 0.0F});
  }
  return key;
}

}  // namespace

AnswerCache::AnswerCache(std::unique_ptr<PromptedSegmenter> segmenter)
    : segmenter_(std::move(segmenter)) {}

absl::Status AnswerCache::SetPhotograph(const Image& photo) {
  if (photo.pixels.data() == photo_) return absl::OkStatus();
  answers_.clear();
  const double start = ProcessorSeconds();
  RETURN_IF_ERROR(segmenter_->SetPhotograph(photo));
  photo_seconds_ += ProcessorSeconds() - start;
  ++num_photos_;
  photo_ = photo.pixels.data();
  grid_ = AnswerGrid(photo.width, photo.height);
  return absl::OkStatus();
}

absl::StatusOr<PromptAnswers> AnswerCache::Segment(std::span<const SegmenterPrompt> prompts) {
  std::vector<SegmenterPrompt> unknown;
  for (const SegmenterPrompt& prompt : prompts) {
    if (!answers_.contains(KeyOf(prompt))) unknown.push_back(prompt);
  }
  if (!unknown.empty()) {
    const double start = ProcessorSeconds();
    ASSIGN_OR_RETURN(const PromptAnswers fresh, segmenter_->Segment(unknown));
    prompt_seconds_ += ProcessorSeconds() - start;
    num_prompts_ += static_cast<int64_t>(unknown.size());
    const size_t cells = fresh.logits.size() / unknown.size();
    for (size_t i = 0; i < unknown.size(); ++i) {
      Answer& answer = answers_[KeyOf(unknown[i])];
      for (size_t cell = i * cells; cell < (i + 1) * cells; ++cell) {
        const float tenths = std::clamp(fresh.logits[cell] * 10, -127.0F, 127.0F);
        answer.tenths.push_back(static_cast<int8_t>(std::lround(tenths)));
      }
      const auto ious = fresh.ious.begin() + static_cast<int64_t>(i) * PromptAnswers::kMasks;
      answer.ious.assign(ious, ious + PromptAnswers::kMasks);
    }
  }
  PromptAnswers answers = grid_;
  for (const SegmenterPrompt& prompt : prompts) {
    const Answer& answer = answers_[KeyOf(prompt)];
    for (const int8_t tenths : answer.tenths) answers.logits.push_back(tenths * 0.1F);
    answers.ious.insert(answers.ious.end(), answer.ious.begin(), answer.ious.end());
  }
  return answers;
}

double AnswerCache::seconds_per_photograph() const {
  return photo_seconds_ / static_cast<double>(std::max<int64_t>(1, num_photos_));
}

double AnswerCache::seconds_per_prompt() const {
  return prompt_seconds_ / static_cast<double>(std::max<int64_t>(1, num_prompts_));
}

}  // namespace pepeseg
