#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "absl/status/statusor.h"
#include "core/priors/sam/device_sam.h"
#include "core/priors/sam/prompted_segmenter.h"

namespace pepeseg {

// SAM's networks on the CPU's own kernels: each segmenter that works at the same time has networks
// and a backend of its own, because a photograph for each thread takes less processor time than
// threads that share one. Takes three quarters of the time of ONNX Runtime
// (tests/bench/results/estimates.md). Thread-safe.
class CpuSam {
 public:
  // Opens networks for one segmenter.
  using Open = std::function<absl::StatusOr<std::unique_ptr<DeviceSam>>()>;
  // Opens the first networks. Returns the error of `open`.
  static absl::StatusOr<std::unique_ptr<CpuSam>> Make(Open open);

  // Returns a segmenter for the photographs of one thread. This must outlive it. Its networks are
  // those that another segmenter has left, or opened by its first SetPhotograph or SetEmbedding,
  // which returns the error of that.
  std::unique_ptr<PromptedSegmenter> MakeSegmenter();

  // Makes all present and later calls to the segmenters return CANCELLED, each after at most the
  // work of one call of a network: about a second. Any thread may call it.
  void Interrupt();

 private:
  friend class CpuSegmenter;
  explicit CpuSam(Open open) : open_(std::move(open)) {}
  absl::StatusOr<DeviceSam*> Take();
  void Leave(DeviceSam* sam);

  const Open open_;
  std::mutex mutex_;  // guards the members below
  std::vector<std::unique_ptr<DeviceSam>> all_;
  std::vector<DeviceSam*> idle_;  // those of no segmenter
  bool interrupted_ = false;
};

}  // namespace pepeseg
