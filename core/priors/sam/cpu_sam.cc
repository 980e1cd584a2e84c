#include "core/priors/sam/cpu_sam.h"

#include <utility>

#include "core/base/status_macros.h"
#include "core/priors/sam/mask_proposals.h"

namespace pepeseg {

// Enlarges masks by the host's step, OpenCV's, which is the fastest on the CPU.
class CpuSegmenter : public PromptedSegmenter {
 public:
  explicit CpuSegmenter(CpuSam& owner) : owner_(owner) {}
  ~CpuSegmenter() override {
    if (sam_ != nullptr) owner_.Leave(sam_);
  }

  absl::Status SetPhotograph(const Image& photo) override {
    RETURN_IF_ERROR(TakeNetworks());
    return calls_->SetPhotograph(photo);
  }
  absl::Status SetEmbedding(const SamEmbedding& embedding) override {
    RETURN_IF_ERROR(TakeNetworks());
    return calls_->SetEmbedding(embedding);
  }
  absl::StatusOr<SamEmbedding> Embedding() override { return calls_->Embedding(); }
  absl::StatusOr<PromptAnswers> SegmentByMask(const MaskPrompt& prompt) override {
    return calls_->SegmentByMask(prompt);
  }
  int extent() const override {
    return calls_ == nullptr ? PromptAnswers::kExtent : calls_->extent();
  }
  absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) override {
    return calls_->Segment(prompts);
  }
  absl::StatusOr<Proposals> Propose(const ProposalRequest& request,
                                    absl::FunctionRef<absl::Status()> progress) override {
    // Only the host's steps can leave prompts out.
    if (request.settled_area > 0) return PromptedSegmenter::Propose(request, progress);
    return calls_->Propose(request, progress);
  }
  absl::StatusOr<std::vector<ProposedMask>> Match(
      std::span<const TargetedPrompt> prompts,
      absl::FunctionRef<absl::Status()> progress) override {
    return calls_->Match(prompts, progress);
  }

 private:
  absl::Status TakeNetworks() {
    if (sam_ != nullptr) return absl::OkStatus();
    ASSIGN_OR_RETURN(sam_, owner_.Take());
    calls_ = sam_->MakeSegmenter();
    return absl::OkStatus();
  }

  CpuSam& owner_;
  DeviceSam* sam_ = nullptr;
  std::unique_ptr<PromptedSegmenter> calls_;  // of sam_
};

absl::StatusOr<std::unique_ptr<CpuSam>> CpuSam::Make(Open open) {
  std::unique_ptr<CpuSam> sam(new CpuSam(std::move(open)));
  ASSIGN_OR_RETURN(DeviceSam * first, sam->Take());
  sam->Leave(first);
  return sam;
}

std::unique_ptr<PromptedSegmenter> CpuSam::MakeSegmenter() {
  return std::make_unique<CpuSegmenter>(*this);
}

// Opens without the mutex, which takes a while.
absl::StatusOr<DeviceSam*> CpuSam::Take() {
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      DeviceSam* sam = idle_.back();
      idle_.pop_back();
      return sam;
    }
  }
  ASSIGN_OR_RETURN(std::unique_ptr<DeviceSam> sam, open_());
  const std::lock_guard lock(mutex_);
  if (interrupted_) sam->Interrupt();
  all_.push_back(std::move(sam));
  return all_.back().get();
}

void CpuSam::Leave(DeviceSam* sam) {
  const std::lock_guard lock(mutex_);
  idle_.push_back(sam);
}

void CpuSam::Interrupt() {
  const std::lock_guard lock(mutex_);
  interrupted_ = true;
  for (const auto& sam : all_) sam->Interrupt();
}

}  // namespace pepeseg
