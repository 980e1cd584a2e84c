#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "kernels/ops/cluster.h"
#include "kernels/ops/density.h"
#include "kernels/ops/depth.h"
#include "kernels/ops/feature.h"
#include "kernels/ops/perception.h"
#include "kernels/ops/refine.h"
#include "kernels/ops/render.h"
#include "kernels/ops/smooth.h"

namespace pepeseg {

// Memory of a whole device, shared with other processes.
struct DeviceMemory {
  int64_t free_bytes = 0;  // what this process could still have
  int64_t total_bytes = 0;
  bool is_host = false;  // the machine's own: data on the host come out of it too
};

// What a backend could not do.
struct BackendError {
  std::string what;    // empty: nothing has failed
  bool fatal = false;  // else memory, or room of another kind, that could not be had
};

// What a RenderScratch grows with.
struct ScratchSize {
  int64_t num_gaussians = 0, num_entries = 0, num_tiles = 0, num_pixels = 0;
  bool for_backward = true;  // of RenderArgs
};

// The arithmetic of the method on one device: its memory, and one virtual per pipeline step.
//
// Ops return nothing: a backend keeps its first error, error() tells, and what is called after it
// does nothing until TakeError forgets it. On CUDA they are asynchronous, in the order of the
// calls. Spans must be memory of the same backend and not overlap unless an op says so. Ops may be
// called from several threads at once as long as what they write is not shared. CPU results do not
// depend on the number of threads.
class Backend {
 public:
  virtual ~Backend() = default;

  virtual std::string name() const = 0;   // for reports, as in "cpu (2 threads, AVX3)"
  virtual std::string error() const = 0;  // empty while nothing has failed
  virtual void Sync() = 0;                // waits for everything that was called before
  // Waits as Sync does and tells the error. One that is not fatal is forgotten by that: what was
  // called since did nothing, and what is called next works again. A fatal one stays.
  virtual BackendError TakeError() = 0;
  // For those who share a backend and want its errors to be their own: to be held from the first
  // op to TakeError. No op takes it.
  std::mutex& exclusive_use() { return exclusive_use_; }

  // Memory; see Buffer.
  virtual void* Allocate(size_t num_bytes) = 0;
  virtual void Free(void* data) = 0;
  virtual void CopyFromHost(void* to, const void* from_host, size_t num_bytes) = 0;
  virtual void CopyToHost(void* to_host, const void* from, size_t num_bytes) = 0;
  virtual void Copy(void* to, const void* from, size_t num_bytes) = 0;
  virtual void Zero(void* data, size_t num_bytes) = 0;
  virtual size_t bytes_in_use() const = 0;
  virtual size_t peak_bytes_in_use() const = 0;
  virtual DeviceMemory memory() const = 0;
  // Gives memory that was freed, and is kept for the next Allocate, back for other processes.
  virtual void ReleaseFreed() = 0;
  // What Render, ImageLoss and RenderBackward take at most of this memory for a scratch of this
  // size and for themselves, depth left out.
  virtual int64_t ScratchBytes(const ScratchSize& size) const = 0;

  // Runs `ops`, calls of this backend that wait for nothing (see RenderArgs::entry_room). On CUDA
  // they are recorded and launched as one graph; the graph of the same key is kept and updated with
  // what has changed in it.
  virtual void Sequence(int key, const std::function<void()>& ops) = 0;

  // Copies to the host that nobody waits for; see ReadbackQueue.
  virtual void* AllocatePinned(size_t num_bytes) = 0;  // host memory; nullptr when there is none
  virtual void FreePinned(void* data) = 0;
  // Returns a ticket for WaitFor. At most kMaxReadbacks may be under way.
  virtual int64_t CopyToHostLater(void* to_pinned, const void* from, size_t num_bytes) = 0;
  virtual void WaitFor(int64_t ticket) = 0;
  // How many steps of work the caller should queue before it waits for the oldest: 0 where calls
  // are done when they return.
  virtual int queue_depth() const = 0;

  // Rendering and stage one (ops/render.h, ops/depth.h, ops/refine.h).
  virtual void Render(const RenderArgs& args) = 0;
  virtual void ImageLoss(const ImageLossArgs& args) = 0;
  virtual void DepthLoss(const DepthLossArgs& args) = 0;
  virtual void RenderBackward(const RenderBackwardArgs& args) = 0;
  virtual void ProjectBackward(const ProjectBackwardArgs& args) = 0;
  virtual void Update(const UpdateArgs& args) = 0;
  virtual void RefineGaussians(const RefineGaussiansArgs& args) = 0;
  // Density control (ops/density.h).
  virtual void PlanDensity(const PlanDensityArgs& args) = 0;
  virtual void GatherRows(const GatherRowsArgs& args) = 0;

  // Rows and features of a rendered view (ops/render.h).
  virtual void CaptureRows(const CaptureRowsArgs& args) = 0;
  virtual void RenderFeatures(const RenderFeaturesArgs& args) = 0;

  // Stage two and queries (ops/feature.h, ops/perception.h, ops/smooth.h).
  virtual void TransposeRows(const TransposeRowsArgs& args) = 0;
  virtual void FeatureCatchUp(const FeatureCatchUpArgs& args) = 0;
  virtual void FeatureRows(const FeatureRowsArgs& args) = 0;
  virtual void PairLoss(const PairLossArgs& args) = 0;
  virtual void CentroidLoss(const CentroidLossArgs& args) = 0;
  virtual void PerceptionLoss(const PerceptionLossArgs& args) = 0;
  virtual void FeatureUpdate(const FeatureUpdateArgs& args) = 0;
  virtual void NeighborRows(const NeighborRowsArgs& args) = 0;
  virtual void SmoothFeatures(const SmoothFeaturesArgs& args) = 0;
  virtual void SmoothBackward(const SmoothBackwardArgs& args) = 0;
  virtual void Similarity(const SimilarityArgs& args) = 0;
  virtual void SegmentPixels(const SegmentPixelsArgs& args) = 0;
  virtual void LevelOverlaps(const LevelOverlapsArgs& args) = 0;
  // Clustering (ops/cluster.h).
  virtual void SpanningTree(const SpanningTreeArgs& args) = 0;

 private:
  std::mutex exclusive_use_;
};

inline constexpr int kMaxReadbacks = 64;

// num_threads = 0: as many as the machine has.
std::unique_ptr<Backend> MakeCpuBackend(int num_threads = 0);

// Device time by kernel, of the calls since the last Sync that filled it.
struct KernelTime {
  std::string name;
  double ms = 0;  // over all calls
  int64_t calls = 0;
};
struct CudaOptions {
  int device = 0;
  std::vector<KernelTime>* kernel_times = nullptr;  // filled by Sync; costs an event a kernel
};
// nullptr and the reason in `error` when this build or this machine has no usable CUDA device.
std::unique_ptr<Backend> MakeCudaBackend(const CudaOptions& options, std::string* error);

}  // namespace pepeseg
