#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "kernels/ops/cell_masks.h"
#include "kernels/ops/cluster.h"
#include "kernels/ops/density.h"
#include "kernels/ops/feature.h"
#include "kernels/ops/match.h"
#include "kernels/ops/network.h"
#include "kernels/ops/prompt_network.h"
#include "kernels/ops/refine.h"
#include "kernels/ops/render.h"
#include "kernels/ops/rows.h"
#include "kernels/ops/sift.h"
#include "kernels/ops/similarity.h"
#include "kernels/ops/smooth.h"

namespace pepeseg {

// Memory of a whole device, which it shares with other processes.
struct DeviceMemory {
  int64_t free_bytes = 0;   // what this process could still allocate
  int64_t total_bytes = 0;  // size of the device's memory, or the limit of this process
  bool is_host = false;     // true: the machine's own memory, which also holds the host's data
};

// The error that a backend keeps.
struct BackendError {
  std::string what;  // message; empty: nothing has failed
  // True: the device or the caller is broken. False: memory, or another limited resource, ran out.
  bool fatal = false;
};

// The sizes that the memory of a RenderScratch depends on.
struct ScratchSize {
  int64_t num_gaussians = 0, num_entries = 0, num_tiles = 0, num_pixels = 0;
  bool for_backward = true;  // see RenderArgs
};

// Priority of a twin's queue (Backend::MakeTwin). kFirst: where both have work, its work is begun
// first, as far as the device can.
enum class QueuePriority { kSame, kFirst };

// The arithmetic of the method on one device: its memory, and one virtual for each pipeline step.
//
// Errors. Ops return nothing. The backend keeps its first error (on CUDA, a fatal one replaces one
// that is not), and every op called after it returns without doing anything, so that outputs are
// unspecified. error() reports the error; TakeError() clears it unless it is fatal.
//
// Order. On the CPU an op is done when it returns. On CUDA ops are asynchronous and run in the
// order of the calls; only those that say so wait on the host. Arguments are copied by the call,
// but the memory that they refer to must stay alive until the op has run. Freeing a Buffer is
// ordered after the ops before it and needs no Sync.
//
// Memory. Spans must be memory of the same backend. They must not overlap unless an op says so.
//
// Threads. All virtuals may be called from several threads at once, as long as the outputs and
// scratches of the calls differ. An error then stops all of them: threads that need their own
// errors hold exclusive_use().
//
// Results do not depend on the number of threads of the CPU backend. They differ between devices
// and instruction sets within rounding, see kernels/NUMERICS.md.
class Backend {
 public:
  virtual ~Backend() = default;

  // Name for reports, such as "cpu (2 threads, AVX3)".
  virtual std::string name() const = 0;
  // Message of the error that is kept; empty: nothing has failed. Does not wait, so on CUDA it may
  // miss the error of an op that has not run yet.
  virtual std::string error() const = 0;
  // Blocks until everything called before has run.
  virtual void Sync() = 0;
  // Blocks as Sync does, and returns the error. If the error is not fatal it is cleared, and ops
  // work again; ops called since the error did nothing. A fatal error stays.
  virtual BackendError TakeError() = 0;
  // Lock for threads that share a backend and need its errors to be their own. They hold it from
  // their first op to TakeError. No virtual takes it.
  std::mutex& exclusive_use() { return exclusive_use_; }

  // Memory. Called by Buffer, which is what callers should use.
  //
  // Returns zero-filled memory, or nullptr when out of memory, which becomes the error.
  virtual void* Allocate(size_t num_bytes) = 0;
  // Frees memory of Allocate; works after an error, too. nullptr is allowed.
  virtual void Free(void* data) = 0;
  // Copies from the host. `from_host` may be reused when it returns, unless it is pinned memory.
  virtual void CopyFromHost(void* to, const void* from_host, size_t num_bytes) = 0;
  // Copies to the host, after the work that writes `from`. Blocks until the copy has arrived.
  virtual void CopyToHost(void* to_host, const void* from, size_t num_bytes) = 0;
  // Copies within the backend.
  virtual void Copy(void* to, const void* from, size_t num_bytes) = 0;
  // Sets bytes to 0.
  virtual void Zero(void* data, size_t num_bytes) = 0;
  // Sum of the sizes passed to Allocate and not yet freed, and the largest value it has had.
  virtual size_t bytes_in_use() const = 0;
  virtual size_t peak_bytes_in_use() const = 0;
  // Memory of the device now.
  virtual DeviceMemory memory() const = 0;
  // Returns memory to other processes that was freed and is kept for the next Allocate. Blocks as
  // Sync does.
  virtual void ReleaseFreed() = 0;
  // Upper bound, in bytes of Allocate, of what Render, ImageLoss and RenderBackward take for a
  // scratch of this size and for themselves, without rendered depth.
  virtual int64_t ScratchBytes(const ScratchSize& size) const = 0;

  // Runs `ops`, which calls ops of this backend that do not wait on the host (see
  // RenderArgs::tile_entry_capacity). On CUDA they are recorded and launched as one graph; the
  // graph of the same key is kept and updated with what has changed. `ops` is called once, before
  // this returns.
  virtual void Sequence(int key, const std::function<void()>& ops) = 0;
  // Runs `parts`, each of which calls ops of this backend. A part must not write what another one
  // reads or writes. On CUDA, within a Sequence, the device may run up to num_branches() parts at
  // once; elsewhere they run one after the other. Each is called once, in order, before this
  // returns; ops called later run after all of them.
  virtual void Branches(std::span<const std::function<void()>> parts) = 0;
  // Number of parts that Branches can run at once; 1 to kMaxBranches.
  virtual int num_branches() const = 0;

  // Copies to the host without waiting. Called by ReadbackQueue, which is what callers should use.
  //
  // Returns host memory for CopyToHostLater, which ops may also read; nullptr when there is none,
  // which becomes the error.
  virtual void* AllocatePinned(size_t num_bytes) = 0;
  // Frees memory of AllocatePinned. Blocks until copies to it have arrived, and ops have read it.
  virtual void FreePinned(void* data) = 0;
  // Queues a copy, after the ops before it, and returns a ticket for WaitFor. At most kMaxReadbacks
  // copies of a backend may be under way.
  virtual int64_t CopyToHostLater(void* to_pinned, const void* from, size_t num_bytes) = 0;
  // Blocks until the copy of this ticket has arrived. After an error it returns at once.
  virtual void WaitFor(int64_t ticket) = 0;
  // Number of steps that the caller should queue before it waits for the oldest. 0: ops are done
  // when they return.
  virtual int queue_depth() const = 0;
  // Returns a backend of the same device with a queue and errors of its own, for what another
  // thread computes meanwhile. priority: of its queue, against that of this one. Null where
  // queue_depth() is 0, and where it could not be made. Ops of one may read memory of the other: it
  // must have been written before a Sync of its backend, and must not be freed or changed before a
  // Sync of the reader. bytes_in_use() and peak_bytes_in_use() of both are those of both together.
  virtual std::unique_ptr<Backend> MakeTwin(QueuePriority priority) const = 0;

  // Each op is described at its arguments. kernels/cpu and kernels/cuda have it in a file named
  // after it or after its header in kernels/ops.
  //
  // Rendering and stage one (kernels/ops/render.h, refine.h).
  virtual void Render(const RenderArgs& args) = 0;
  virtual void RenderFeatures(const RenderFeaturesArgs& args) = 0;
  virtual void ImageLoss(const ImageLossArgs& args) = 0;
  virtual void DepthLoss(const DepthLossArgs& args) = 0;
  virtual void RenderBackward(const RenderBackwardArgs& args) = 0;
  virtual void AddWeights(const AddWeightsArgs& args) = 0;
  virtual void Update(const UpdateArgs& args) = 0;
  virtual void RefineGaussians(const RefineGaussiansArgs& args) = 0;
  // Density control (kernels/ops/density.h).
  virtual void PlanDensity(const PlanDensityArgs& args) = 0;
  virtual void GatherRows(const GatherRowsArgs& args) = 0;

  // Sparse rows of sampled pixels (kernels/ops/rows.h).
  virtual void CaptureRows(const CaptureRowsArgs& args) = 0;
  virtual void TransposeRows(const TransposeRowsArgs& args) = 0;
  // Stage two (kernels/ops/feature.h, smooth.h).
  virtual void FeatureCatchUp(const FeatureCatchUpArgs& args) = 0;
  virtual void FeatureRows(const FeatureRowsArgs& args) = 0;
  virtual void PairLoss(const PairLossArgs& args) = 0;
  virtual void CentroidLoss(const CentroidLossArgs& args) = 0;
  virtual void PerceptionLoss(const PerceptionLossArgs& args) = 0;
  virtual void FeatureUpdate(const FeatureUpdateArgs& args) = 0;
  virtual void NeighborRows(const NeighborRowsArgs& args) = 0;
  virtual void SmoothFeatures(const SmoothFeaturesArgs& args) = 0;
  virtual void SmoothBackward(const SmoothBackwardArgs& args) = 0;
  // Queries (kernels/ops/similarity.h).
  virtual void Similarity(const SimilarityArgs& args) = 0;
  virtual void SegmentPixels(const SegmentPixelsArgs& args) = 0;
  virtual void RefineBorder(const RefineBorderArgs& args) = 0;
  virtual void PackMask(const PackMaskArgs& args) = 0;
  virtual void LevelOverlaps(const LevelOverlapsArgs& args) = 0;
  // Clustering (kernels/ops/cluster.h).
  virtual void SpanningTree(const SpanningTreeArgs& args) = 0;
  // Poses (kernels/ops/sift.h, match.h).
  virtual void ExtractSift(const ExtractSiftArgs& args) = 0;
  virtual void MatchDescriptors(const MatchDescriptorsArgs& args) = 0;
  // Image networks (kernels/ops/network.h).
  virtual void PrepareFrame(const PrepareFrameArgs& args) = 0;
  virtual void Linear(const LinearArgs& args) = 0;
  virtual void LayerNorm(const LayerNormArgs& args) = 0;
  virtual void Convolve3x3(const Convolve3x3Args& args) = 0;
  virtual void DepthwiseConvolve(const DepthwiseConvolveArgs& args) = 0;
  virtual void WindowAttention(const WindowAttentionArgs& args) = 0;
  // The decoder of SAM (kernels/ops/prompt_network.h).
  virtual void PromptTokens(const PromptTokensArgs& args) = 0;
  virtual void AddToPlaces(const AddToPlacesArgs& args) = 0;
  virtual void UpdateTokens(const UpdateTokensArgs& args) = 0;
  virtual void AttendToPlaces(const AttendToPlacesArgs& args) = 0;
  virtual void UpdatePlaces(const UpdatePlacesArgs& args) = 0;
  virtual void TokenHeads(const TokenHeadsArgs& args) = 0;
  virtual void UpscaleMasks(const UpscaleMasksArgs& args) = 0;
  // Masks of cells (kernels/ops/cell_masks.h).
  virtual void SuppressMasks(const SuppressMasksArgs& args) = 0;
  virtual void EnlargeMasks(const EnlargeMasksArgs& args) = 0;

 private:
  std::mutex exclusive_use_;
};

// Limit on Backend::num_branches().
inline constexpr int kMaxBranches = 8;

// Limit on the copies of CopyToHostLater under way in one backend, over all its queues.
inline constexpr int kMaxReadbacks = 64;

// Makes the CPU backend. num_threads = 0: as many as the machine has.
std::unique_ptr<Backend> MakeCpuBackend(int num_threads = 0);

// Device time of one kernel.
struct KernelTime {
  std::string name;
  double ms = 0;  // over all calls
  int64_t calls = 0;
};
struct CudaOptions {
  int device = 0;  // CUDA's number of the device
  // For benchmarks; may be null. Sync adds the times of the kernels launched since the last Sync.
  // Costs an event for each kernel, and Sequence records no graphs. Must outlive the backend.
  std::vector<KernelTime>* kernel_times = nullptr;
};
// Makes a CUDA backend. Returns nullptr, and the reason in `error`, if this build or this machine
// has no usable CUDA device of that number.
std::unique_ptr<Backend> MakeCudaBackend(const CudaOptions& options, std::string* error);

}  // namespace pepeseg
