#include "core/priors/sam/cpu_sam.h"

#include <utility>

#include "core/base/status_macros.h"

namespace pepeseg {

// Proposes masks by the host's steps of PromptedSegmenter.
class CpuSegmenter : public PromptedSegmenter {
 public:
  explicit CpuSegmenter(CpuSam& owner) : owner_(owner) {}
  ~CpuSegmenter() override {
    if (sam_ != nullptr) owner_.Leave(sam_);
  }

  absl::Status SetPhotograph(const Image& photo) override {
    if (sam_ == nullptr) {
      ASSIGN_OR_RETURN(sam_, owner_.Take());
      calls_ = sam_->MakeSegmenter();
    }
    return calls_->SetPhotograph(photo);
  }
  int extent() const override {
    return calls_ == nullptr ? PromptAnswers::kExtent : calls_->extent();
  }
  absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) override {
    return calls_->Segment(prompts);
  }

 private:
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
