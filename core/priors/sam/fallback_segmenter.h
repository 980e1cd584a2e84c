#pragma once

#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "core/priors/sam/mask_proposals.h"
#include "core/priors/sam/prompted_segmenter.h"

namespace pepeseg {

// A segmenter on a device that goes over to another one when the device is out of memory or fails:
// when a call returns RESOURCE_EXHAUSTED or INTERNAL. The call is then repeated there, and later
// ones go there at once.
class FallbackSegmenter : public PromptedSegmenter {
 public:
  // Returns the segmenter to go over to after this error, with as many cells along a side; or an
  // error, which becomes that of the call.
  using Other =
      std::function<absl::StatusOr<std::unique_ptr<PromptedSegmenter>>(const absl::Status& why)>;
  FallbackSegmenter(std::unique_ptr<PromptedSegmenter> first, Other other)
      : current_(std::move(first)), other_(std::move(other)) {}

  int extent() const override { return current_->extent(); }
  absl::Status SetPhotograph(const Image& photo) override;
  absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) override;
  absl::StatusOr<Proposals> Propose(const ProposalRequest& request,
                                    absl::FunctionRef<absl::Status()> progress) override;
  absl::StatusOr<std::vector<ProposedMask>> Match(
      std::span<const TargetedPrompt> prompts, absl::FunctionRef<absl::Status()> progress) override;
  absl::StatusOr<std::vector<std::vector<PixelRun>>> Enlarge(std::span<const ProposedMask> masks,
                                                             const View& view) override;
  absl::StatusOr<SamEmbedding> Embedding() override;
  absl::Status SetEmbedding(const SamEmbedding& embedding) override;
  absl::StatusOr<PromptAnswers> SegmentByMask(const MaskPrompt& prompt) override;

 private:
  bool GoesOver(const absl::Status& status) const;
  absl::Status GoOver(const absl::Status& why);
  template <class Call>
  auto Repeated(const Call& call) -> decltype(call());

  std::unique_ptr<PromptedSegmenter> current_;
  Other other_;  // null: current_ is the other one
  // The one that was set last; the other is null.
  const Image* photo_ = nullptr;
  const SamEmbedding* embedding_ = nullptr;
};

}  // namespace pepeseg
