#include "core/priors/sam/fallback_segmenter.h"

#include "core/base/status_macros.h"

namespace pepeseg {

bool FallbackSegmenter::GoesOver(const absl::Status& status) const {
  return other_ != nullptr && (absl::IsResourceExhausted(status) || absl::IsInternal(status));
}

// Replaces the segmenter and gives the new one the photograph.
absl::Status FallbackSegmenter::GoOver(const absl::Status& why) {
  ASSIGN_OR_RETURN(current_, other_(why));
  other_ = nullptr;
  return photo_ != nullptr ? current_->SetPhotograph(*photo_) : current_->SetEmbedding(*embedding_);
}

template <class Call>
auto FallbackSegmenter::Repeated(const Call& call) -> decltype(call()) {
  auto result = call();
  if (!GoesOver(result.status())) return result;
  RETURN_IF_ERROR(GoOver(result.status()));
  return call();
}

absl::Status FallbackSegmenter::SetPhotograph(const Image& photo) {
  photo_ = &photo;
  embedding_ = nullptr;
  const absl::Status status = current_->SetPhotograph(photo);
  return GoesOver(status) ? GoOver(status) : status;
}

absl::StatusOr<PromptAnswers> FallbackSegmenter::Segment(std::span<const SegmenterPrompt> prompts) {
  return Repeated([&] { return current_->Segment(prompts); });
}

absl::StatusOr<Proposals> FallbackSegmenter::Propose(const ProposalRequest& request,
                                                     absl::FunctionRef<absl::Status()> progress) {
  return Repeated([&] { return current_->Propose(request, progress); });
}

absl::StatusOr<std::vector<ProposedMask>> FallbackSegmenter::Match(
    std::span<const TargetedPrompt> prompts, absl::FunctionRef<absl::Status()> progress) {
  return Repeated([&] { return current_->Match(prompts, progress); });
}

absl::StatusOr<std::vector<std::vector<PixelRun>>> FallbackSegmenter::Enlarge(
    std::span<const ProposedMask> masks, const View& view) {
  return Repeated([&] { return current_->Enlarge(masks, view); });
}

absl::StatusOr<SamEmbedding> FallbackSegmenter::Embedding() {
  return Repeated([&] { return current_->Embedding(); });
}

absl::Status FallbackSegmenter::SetEmbedding(const SamEmbedding& embedding) {
  embedding_ = &embedding;
  photo_ = nullptr;
  const absl::Status status = current_->SetEmbedding(embedding);
  return GoesOver(status) ? GoOver(status) : status;
}

absl::StatusOr<PromptAnswers> FallbackSegmenter::SegmentByMask(const MaskPrompt& prompt) {
  return Repeated([&] { return current_->SegmentByMask(prompt); });
}

}  // namespace pepeseg
