#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "kernels/backend.h"
#include "kernels/cpu/reusable.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

// The CPU implementation. Each op is in the file of its name next to this one, and its inner loops
// in simd/. An op splits its work into tasks whose size does not depend on the number of threads,
// runs them on the pool, and adds the results of the tasks in their order: this is why results do
// not depend on the number of threads. Ops called from several threads run their parallel parts one
// at a time (ThreadPool).
class CpuBackend final : public Backend {
 public:
  explicit CpuBackend(int num_threads);

  std::string name() const override;
  std::string error() const override;
  void Sync() override {}
  BackendError TakeError() override;

  void* Allocate(size_t num_bytes) override;
  void Free(void* data) override;
  void CopyFromHost(void* to, const void* from_host, size_t num_bytes) override;
  void CopyToHost(void* to_host, const void* from, size_t num_bytes) override;
  void Copy(void* to, const void* from, size_t num_bytes) override;
  void Zero(void* data, size_t num_bytes) override;
  size_t bytes_in_use() const override { return bytes_in_use_; }
  size_t peak_bytes_in_use() const override { return peak_bytes_; }
  DeviceMemory memory() const override;
  void ReleaseFreed() override;
  int64_t ScratchBytes(const ScratchSize& size) const override;
  void Sequence(int, const std::function<void()>& ops) override { ops(); }
  void Branches(std::span<const std::function<void()>> parts) override {
    for (const auto& part : parts) part();
  }
  int num_branches() const override { return 1; }
  void* AllocatePinned(size_t num_bytes) override { return Allocate(num_bytes); }
  void FreePinned(void* data) override { Free(data); }
  int64_t CopyToHostLater(void* to_pinned, const void* from, size_t num_bytes) override {
    Copy(to_pinned, from, num_bytes);
    return 0;
  }
  void WaitFor(int64_t) override {}
  int queue_depth() const override { return 0; }
  std::unique_ptr<Backend> MakeTwin(QueuePriority /*priority*/) const override { return nullptr; }

  void Render(const RenderArgs& args) override;
  void ImageLoss(const ImageLossArgs& args) override;
  void DepthLoss(const DepthLossArgs& args) override;
  void RenderBackward(const RenderBackwardArgs& args) override;
  void AddWeights(const AddWeightsArgs& args) override;
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
  void RefineBorder(const RefineBorderArgs& args) override;
  void PackMask(const PackMaskArgs& args) override;
  void LevelOverlaps(const LevelOverlapsArgs& args) override;
  void SpanningTree(const SpanningTreeArgs& args) override;
  void MatchDescriptors(const MatchDescriptorsArgs& args) override;
  void PrepareFrame(const PrepareFrameArgs& args) override;
  void Linear(const LinearArgs& args) override;
  void LayerNorm(const LayerNormArgs& args) override;
  void Convolve3x3(const Convolve3x3Args& args) override;
  void DepthwiseConvolve(const DepthwiseConvolveArgs& args) override;
  void WindowAttention(const WindowAttentionArgs& args) override;
  void ExtractSift(const ExtractSiftArgs& args) override;
  void PromptTokens(const PromptTokensArgs& args) override;
  void AddToPlaces(const AddToPlacesArgs& args) override;
  void UpdateTokens(const UpdateTokensArgs& args) override;
  void AttendToPlaces(const AttendToPlacesArgs& args) override;
  void UpdatePlaces(const UpdatePlacesArgs& args) override;
  void TokenHeads(const TokenHeadsArgs& args) override;
  void UpscaleMasks(const UpscaleMasksArgs& args) override;
  void SuppressMasks(const SuppressMasksArgs& args) override;
  void EnlargeMasks(const EnlargeMasksArgs& args) override;

 private:
  // Keeps the error if there is none yet. From any thread.
  void Fail(const BackendError& error);
  // True while an error is kept; every op then returns at once.
  bool failed() const { return failed_; }

  ThreadPool pool_;
  const SimdKernels& simd_;
  // Working memory that ops of each step use again.
  Reusable<PairMemory> pair_memory_;
  Reusable<std::vector<float>> values_;
  std::atomic<size_t> bytes_in_use_ = 0, peak_bytes_ = 0;
  std::atomic<bool> failed_ = false;  // whether error_ is set, readable without the lock
  mutable std::mutex error_mutex_;
  BackendError error_;  // guarded by error_mutex_
};

}  // namespace pepeseg
