#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "core/priors/sam/prompted_segmenter.h"

namespace pepeseg {

struct SamOptions {
  int num_threads = 1;
  // Photographs that segmenters of the model work on at the same time, at most `num_threads`. The
  // thread of each computes, and the other threads help all of them.
  int photographs_at_once = 1;
  // Number of a GPU, which computes where the folder has ONNX Runtime's CUDA provider (sam_files.h)
  // and that works. Absent: only the CPU computes.
  std::optional<int> cuda_device = std::nullopt;
};

// The networks of a small SAM (TinyViT's encoder) from a folder that deploy/sam.sh has made.
class SamModel {
 public:
  // The errors of CheckSamFiles; FAILED_PRECONDITION also where the library does not load or the
  // models are not the expected ones; RESOURCE_EXHAUSTED: out of memory.
  static absl::StatusOr<std::unique_ptr<SamModel>> Open(const std::filesystem::path& folder,
                                                        const SamOptions& options);
  ~SamModel();

  // What computes: "the CPU" or "CUDA device 0". Where CUDA was tried, it says why it does not.
  const std::string& processor() const;

  // For the photographs of one thread. The model must outlive it.
  std::unique_ptr<PromptedSegmenter> MakeSegmenter() const;

  // Any thread may call it: what the model's segmenters do, and what they are asked later, ends
  // with CANCELLED.
  void Interrupt() const;

 private:
  struct Networks;
  explicit SamModel(std::unique_ptr<const Networks> networks);

  std::unique_ptr<const Networks> networks_;
};

}  // namespace pepeseg
