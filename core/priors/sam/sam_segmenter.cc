#include "core/priors/sam/sam_segmenter.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/priors/sam/cpu_sam.h"
#include "core/priors/sam/device_sam.h"
#include "core/priors/sam/fallback_segmenter.h"
#include "core/priors/sam/onnx_segmenter.h"
#include "core/priors/sam/sam_networks.h"

namespace pepeseg {

SamModel::SamModel(const std::filesystem::path& folder, const SamOptions& options)
    : folder_(folder), options_(options) {}
SamModel::~SamModel() = default;

absl::StatusOr<std::unique_ptr<SamModel>> SamModel::Open(const std::filesystem::path& folder,
                                                         const SamOptions& options) {
  RETURN_IF_ERROR(CheckSamFiles(folder));
  std::unique_ptr<SamModel> model(new SamModel(folder, options));
  ASSIGN_OR_RETURN(model->encoder_digest_, SamEncoderDigest(folder));
  if (options.cuda_device) model->OpenDevice();
  if (model->device_ == nullptr) RETURN_IF_ERROR(model->OpenCpu());
  return model;
}

void SamModel::OpenDevice() {
  auto device = DeviceSam::Open(folder_, *options_.cuda_device);
  if (device.ok()) {
    device_ = *std::move(device);
  } else {
    cuda_failure_ = std::string(device.status().message());
  }
}

// Does nothing when called again. Opens without mutex_, so that Interrupt need not wait.
absl::Status SamModel::OpenCpu() {
  const std::lock_guard opening(opening_);
  if (cpu_ != nullptr || networks_ != nullptr) return absl::OkStatus();  // only this sets them
  if (options_.before_cpu) options_.before_cpu();
  // A segmenter computes on the thread that calls it and on per_segmenter - 1 threads of its own,
  // so that the callers and the pool make num_threads.
  const int at_once = options_.mask_prompts ? 1 : SamPhotographsAtOnce(options_.num_threads);
  const int per_segmenter = std::max(1, options_.num_threads - at_once + 1);
  if (!options_.onnx_runtime) {
    auto cpu = CpuSam::Make(
        [this, per_segmenter] { return DeviceSam::OpenOnCpu(folder_, per_segmenter); });
    if (cpu.ok()) {
      const std::lock_guard lock(mutex_);
      cpu_ = *std::move(cpu);
      if (interrupted_) cpu_->Interrupt();
      return absl::OkStatus();
    }
    // Networks of another shape, which the own kernels do not know, are for ONNX Runtime.
    if (!absl::IsFailedPrecondition(cpu.status())) return cpu.status();
  }
  const OnnxGraphEdit edit = options_.mask_prompts ? MaskDecoderEdit() : PointDecoderEdit();
  ASSIGN_OR_RETURN(auto networks, SamNetworks::Open(folder_, edit, {per_segmenter}));
  const std::lock_guard lock(mutex_);
  networks_ = std::move(networks);
  if (interrupted_) networks_->Interrupt();
  return absl::OkStatus();
}

std::unique_ptr<PromptedSegmenter> SamModel::MakeCpuSegmenter() {
  return cpu_ != nullptr ? cpu_->MakeSegmenter()
                         : MakeOnnxSegmenter(*networks_, options_.mask_prompts);
}

std::string SamModel::processor() const {
  const std::lock_guard lock(mutex_);
  if (!cuda_failure_.empty()) return absl::StrCat("the CPU, since CUDA failed: ", cuda_failure_);
  return device_ == nullptr ? "the CPU" : absl::StrCat("CUDA device ", *options_.cuda_device);
}

int64_t SamModel::peak_device_bytes() const {
  const std::lock_guard lock(mutex_);
  return device_ == nullptr ? 0 : static_cast<int64_t>(device_->backend().peak_bytes_in_use());
}

bool SamModel::on_device() const {
  const std::lock_guard lock(mutex_);
  return device_ != nullptr && cuda_failure_.empty();
}

bool SamModel::cuda_failed() const {
  const std::lock_guard lock(mutex_);
  return !cuda_failure_.empty();
}

std::unique_ptr<PromptedSegmenter> SamModel::MakeSegmenter() {
  const std::lock_guard lock(mutex_);
  if (cpu_ != nullptr || networks_ != nullptr) return MakeCpuSegmenter();
  return std::make_unique<FallbackSegmenter>(
      device_->MakeSegmenter(), [this](const absl::Status& why) { return LeaveDevice(why); });
}

// Opens the networks for the CPU, unless another segmenter has.
absl::StatusOr<std::unique_ptr<PromptedSegmenter>> SamModel::LeaveDevice(const absl::Status& why) {
  {
    const std::lock_guard lock(mutex_);
    if (cuda_failure_.empty()) cuda_failure_ = std::string(why.message());
  }
  RETURN_IF_ERROR(OpenCpu());
  const std::lock_guard lock(mutex_);
  return MakeCpuSegmenter();
}

void SamModel::Interrupt() {
  const std::lock_guard lock(mutex_);
  interrupted_ = true;
  if (device_ != nullptr) device_->Interrupt();
  if (cpu_ != nullptr) cpu_->Interrupt();
  if (networks_ != nullptr) networks_->Interrupt();
}

}  // namespace pepeseg
