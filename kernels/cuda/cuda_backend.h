#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include "kernels/backend.h"

namespace pepeseg {

// An entry sorts by its tile, above `depth` bits of its depth: the bits of a positive float order
// as it does, and all are at least `nearest`.
struct SortKeyBits {
  uint32_t nearest;
  int depth;
};

// Behind the counters of RenderScratch stands the largest depth as its bits.
inline constexpr int kLargestDepth = kNumRenderCounters;
inline constexpr int kNumCudaCounters = kNumRenderCounters + 1;

// The CUDA implementation on one device and one stream: each op stands in the file of its name
// beside this one. Memory comes from the device's stream-ordered pool, so that freeing and growing
// wait for nothing.
class CudaBackend final : public Backend {
 public:
  explicit CudaBackend(const CudaOptions& options);
  ~CudaBackend() override;

  std::string name() const override;
  std::string error() const override;
  void Sync() override;
  BackendError TakeError() override;

  void* Allocate(size_t num_bytes) override;
  void Free(void* data) override;
  void CopyFromHost(void* to, const void* from_host, size_t num_bytes) override;
  void CopyToHost(void* to_host, const void* from, size_t num_bytes) override;
  void Copy(void* to, const void* from, size_t num_bytes) override;
  void Zero(void* data, size_t num_bytes) override;
  size_t bytes_in_use() const override;
  size_t peak_bytes_in_use() const override;
  DeviceMemory memory() const override;
  void ReleaseFreed() override;
  int64_t ScratchBytes(const ScratchSize& size) const override;
  void Sequence(int key, const std::function<void()>& ops) override;
  void* AllocatePinned(size_t num_bytes) override;
  void FreePinned(void* data) override;
  int64_t CopyToHostLater(void* to_pinned, const void* from, size_t num_bytes) override;
  void WaitFor(int64_t ticket) override;
  int queue_depth() const override { return 8; }

  void Render(const RenderArgs& args) override;
  void ImageLoss(const ImageLossArgs& args) override;
  void DepthLoss(const DepthLossArgs& args) override;
  void RenderBackward(const RenderBackwardArgs& args) override;
  void ProjectBackward(const ProjectBackwardArgs& args) override;
  void Update(const UpdateArgs& args) override;
  void RefineGaussians(const RefineGaussiansArgs& args) override;
  void PlanDensity(const PlanDensityArgs& args) override;
  void GatherRows(const GatherRowsArgs& args) override;
  void CaptureRows(const CaptureRowsArgs& args) override;
  void RenderFeatures(const RenderFeaturesArgs& args) override;
  void TransposeRows(const TransposeRowsArgs& args) override;
  void FeatureCatchUp(const FeatureCatchUpArgs& args) override;
  void FeatureRows(const FeatureRowsArgs& args) override;
  void PairLoss(const PairLossArgs& args) override;
  void CentroidLoss(const CentroidLossArgs& args) override;
  void PerceptionLoss(const PerceptionLossArgs& args) override;
  void FeatureUpdate(const FeatureUpdateArgs& args) override;
  void NeighborRows(const NeighborRowsArgs& args) override;
  void SmoothFeatures(const SmoothFeaturesArgs& args) override;
  void SmoothBackward(const SmoothBackwardArgs& args) override;
  void Similarity(const SimilarityArgs& args) override;
  void SegmentPixels(const SegmentPixelsArgs& args) override;
  void LevelOverlaps(const LevelOverlapsArgs& args) override;
  void SpanningTree(const SpanningTreeArgs& args) override;

 private:
  // An op's turn: its launches follow each other on the stream, whatever other threads call.
  // Nothing is launched once an error is kept.
  class Turn {
   public:
    explicit Turn(CudaBackend& backend);
    explicit operator bool() const { return usable_; }

   private:
    std::lock_guard<std::recursive_mutex> lock_;
    bool usable_;
  };

  void Keep(cudaError_t error, const char* doing);
  // The first error stays, but gives way to a fatal one.
  void Fail(BackendError error);
  void Launched(const char* kernel);  // after each launch
  void LaunchSequence(int key, cudaGraph_t graph);
  void ReadKernelTimes();

  // Scratch memory of an op's own, until the next call.
  void* Temporary(size_t num_bytes);

  DensityCounts DecideFates(const PlanDensityArgs& args, DeviceSpan<uint8_t> fate);

  // Parts of Render.
  void ProjectGaussians(const RenderArgs& args);
  SortKeyBits MakeRoom(const RenderArgs& args);
  void ListTileEntries(const RenderArgs& args, const SortKeyBits& bits);

  CudaOptions options_;
  std::string device_name_;
  mutable std::recursive_mutex mutex_;
  cudaStream_t stream_ = nullptr;
  std::string error_;
  bool fatal_ = false;                        // of the error
  std::unordered_map<void*, size_t> blocks_;  // sizes
  size_t bytes_in_use_ = 0, peak_bytes_ = 0;
  // While a sequence is recorded, memory comes from the side stream, which is not, and goes back
  // when the recording is over.
  bool recording_ = false;
  cudaStream_t side_stream_ = nullptr;
  std::vector<void*> freed_while_recording_;
  std::unordered_map<int, cudaGraphExec_t> sequences_;
  int64_t* pinned_counters_ = nullptr;         // [kNumCudaCounters] on the host
  cudaEvent_t readbacks_[kMaxReadbacks] = {};  // ticket k: event k % kMaxReadbacks
  int64_t num_readbacks_ = 0;
  Buffer<std::byte> temporary_;
  struct KernelMark {
    const char* kernel;  // nullptr: an op begins
    cudaEvent_t event;
  };
  std::vector<KernelMark> marks_;
};

}  // namespace pepeseg
