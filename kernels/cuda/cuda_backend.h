#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "kernels/backend.h"
#include "kernels/sift_scales.h"

namespace pepeseg {

// Number of blocks of `block` threads (or elements) that cover `count`. It must be below 2^31, the
// limit of gridDim.x, and below 2^16 for gridDim.y.
inline int NumBlocks(int64_t count, int block) {
  return static_cast<int>((count + block - 1) / block);
}

// Cuts one block of memory into arrays, each at a multiple of 256 bytes. Without a base it only
// adds up the sizes and returns null pointers, so that one function can both size the block (a
// first call on an empty arena) and lay it out (a second call on the block). `base` must be
// 256-byte aligned.
class Arena {
 public:
  explicit Arena(void* base = nullptr) : base_(static_cast<std::byte*>(base)) {}

  // Returns the next `count` elements, uninitialised.
  template <class T>
  T* Take(int64_t count) {
    constexpr size_t kAlign = 256;
    std::byte* at = base_ == nullptr ? nullptr : base_ + num_bytes_;
    num_bytes_ += (static_cast<size_t>(count) * sizeof(T) + kAlign - 1) / kAlign * kAlign;
    return reinterpret_cast<T*>(at);
  }
  // Bytes taken so far, padding included.
  size_t num_bytes() const { return num_bytes_; }

 private:
  std::byte* base_;
  size_t num_bytes_ = 0;
};

// Layout of the sort key of an entry: its tile above `depth` bits of depth. The bits of positive
// floats order as the floats do, so the depth is stored as its bits less `nearest`.
struct SortKeyBits {
  uint32_t nearest;  // bits of the near plane, which all depths exceed
  int depth;         // number of bits that hold a depth
};

// Index of the largest depth of a render, as its bits, which follows the counters of RenderScratch.
inline constexpr int kLargestDepth = kNumRenderCounters;
inline constexpr int kNumCudaCounters = kNumRenderCounters + 1;

// Device memory of a backend and of its twins (Backend::MakeTwin).
struct CudaMemoryUse {
  std::mutex mutex;
  std::unordered_map<void*, size_t> blocks;  // bytes asked for, of each block not yet freed
  size_t bytes = 0, peak_bytes = 0;          // sum of blocks, and its largest value
};

// The CUDA implementation of Backend on one device: each op is in the file of its name next to this
// one.
//
// Streams. Outside of Branches all kernels, copies and frees go to one stream and therefore run in
// the order of the calls; an op needs no synchronisation with the op before it. Within a launch,
// blocks communicate only by atomics on integers, by the running sums of project.cu, and by the
// shortened paths of spanning_tree.cu. The stream does not synchronise with the legacy default
// stream.
//
// Memory comes from the stream-ordered pool of the device, so that freeing and growing wait for
// nothing. What is freed stays in the pool until ReleaseFreed.
//
// Locking. One recursive mutex guards all state. Each op holds it from its first launch to its last
// (Turn), so that the launches of two threads do not interleave.
//
// Graphs. Sequence captures the launches of its ops into a graph each time it is called, updates
// the executable graph of its key in place, and launches it: one launch for all kernels of a step.
// Branches captures each part on a stream of its own, so that the parts become parallel branches
// of the graph. Each branch has its own temporary memory.
//
// Errors of launches and of the runtime are kept (Keep). A fault within a kernel surfaces at a
// later call, at the latest when the host waits.
class CudaBackend final : public Backend {
 public:
  // use: the memory of the backend that this one is a twin of; null: of none.
  // use: of its twins; null: it has none. stream_priority: of its streams, see
  // cudaStreamCreateWithPriority.
  explicit CudaBackend(const CudaOptions& options, std::shared_ptr<CudaMemoryUse> use = nullptr,
                       int stream_priority = 0);
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
  void Branches(std::span<const std::function<void()>> parts) override;
  int num_branches() const override { return kMaxBranches; }
  void* AllocatePinned(size_t num_bytes) override;
  void FreePinned(void* data) override;
  int64_t CopyToHostLater(void* to_pinned, const void* from, size_t num_bytes) override;
  void WaitFor(int64_t ticket) override;
  int queue_depth() const override { return 8; }
  std::unique_ptr<Backend> MakeTwin(QueuePriority priority) const override;

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
  // Held by an op while it launches, so that its launches follow each other on the stream whatever
  // other threads call. Makes the device current on the calling thread. False once an error is
  // kept: the op must then launch nothing. Recursive, because ops call others, such as Zero.
  class Turn {
   public:
    explicit Turn(CudaBackend& backend);
    explicit operator bool() const { return usable_; }

   private:
    std::lock_guard<std::recursive_mutex> lock_;
    bool usable_;
  };

  // All of these are called with the mutex held, or by the constructor.
  //
  // Keeps an error of the runtime; `doing` names the call in the message. Everything but a lack of
  // memory is fatal.
  void Keep(cudaError_t error, const char* doing);
  // Keeps the error, unless there is one already. A fatal error replaces one that is not.
  void Fail(BackendError error);
  // Called after each launch, with the kernel's name for kernel_times: keeps the error of the
  // launch and, when kernels are timed, records an event. nullptr marks the begin of an op.
  void Launched(const char* kernel);
  void LaunchSequence(int key, cudaGraph_t graph);
  void OpenStream(cudaStream_t& stream);
  void OpenBranch(int branch);
  // Adds the times of the kernels launched since the last call. The stream must have been waited
  // for.
  void ReadKernelTimes();

  // Working memory of an op, 256-byte aligned, contents unspecified. Valid until the next call of
  // Temporary: the next op reuses it, ordered by the stream. nullptr if it has to grow and cannot,
  // which is an error.
  void* Temporary(size_t num_bytes);

  // Parts of ExtractSift (sift.cu).
  struct SiftSearch {
    std::span<SiftOctave> octaves;  // of the photograph
    int first, end;                 // those to search
    int which;                      // index of SiftScratch::points
    std::span<int64_t> counts;      // points of each scale, added to
  };
  int FindSiftPoints(const ExtractSiftArgs& args, const SiftSearch& search);
  struct SiftSelection {
    std::span<const SiftOctave> octaves;
    int num_found[2];        // extrema in SiftScratch::points
    int finest;              // scale
    int count, num_coarser;  // points that are kept, and those of octaves 0 to 2 among them
  };
  void DescribeSiftPoints(const ExtractSiftArgs& args, const SiftSelection& selection);

  DensityCounts DecideFates(const PlanDensityArgs& args, DeviceSpan<uint8_t> fate);

  // Parts of Render, in their order.
  void ProjectGaussians(const RenderArgs& args);
  SortKeyBits MakeRoom(const RenderArgs& args);
  void ListTileEntries(const RenderArgs& args, const SortKeyBits& bits);

  CudaOptions options_;
  std::string device_name_;
  mutable std::recursive_mutex mutex_;
  cudaStream_t stream_ = nullptr;  // of the calls; within a part of Branches that of the branch
  std::string error_;
  bool fatal_ = false;  // BackendError::fatal of error_
  const std::shared_ptr<CudaMemoryUse> use_;
  const int stream_priority_;
  // While a sequence is recorded, memory is allocated on the side stream, which is not recorded,
  // and freed when the recording is over: the graph must hold neither.
  bool recording_ = false;
  cudaStream_t side_stream_ = nullptr;
  std::vector<void*> freed_while_recording_;
  std::unordered_map<int, cudaGraphExec_t> sequences_;  // by the key of Sequence
  int64_t* pinned_counters_ = nullptr;                  // [kNumCudaCounters] on the host
  cudaEvent_t readbacks_[kMaxReadbacks] = {};           // ticket k: event k % kMaxReadbacks
  int64_t num_readbacks_ = 0;
  Buffer<std::byte> temporary_[kMaxBranches];  // memory of Temporary by branch; grows only
  // Branch 0 is the stream of the calls itself. The others, and the events that fork and join them,
  // are made when they are first needed.
  int branch_ = 0;  // whose part is being captured
  cudaStream_t branch_streams_[kMaxBranches] = {};
  cudaEvent_t branch_ends_[kMaxBranches] = {};  // of branch 0: where the others begin
  // With kernel_times: an event after each launch, and one where an op begins. The time of a kernel
  // is that between its event and the one before.
  struct KernelMark {
    const char* kernel;  // nullptr: an op begins
    cudaEvent_t event;
  };
  std::vector<KernelMark> marks_;
};

}  // namespace pepeseg
