#include <cuda_runtime.h>

#include <algorithm>
#include <string>

#include "kernels/buffer.h"
#include "kernels/cuda/blend_tile.cuh"
#include "kernels/cuda/cuda_backend.h"

// Memory of the CUDA backend. Device memory is allocated and freed in the order of the stream, from
// the device's default pool: a block that is freed here may be handed out again at once, and is
// used by the device only after the work that was queued before. Pinned memory is that of the host.
//
// ScratchBytes is the memory that rendering and its backward pass need, computed from the element
// types of the scratch's own buffers, so that it follows changes of those. The buffers are sized in
// project.cu, render.cu and render_backward.cu; a buffer that is added there must be added here.

namespace pepeseg {

// Rounds up to 256 bytes, which the memset then fills whole. When memory runs out it trims the pool
// and tries once more; not while a sequence is recorded, as that would wait for the stream.
void* CudaBackend::Allocate(size_t num_bytes) {
  const Turn turn(*this);
  if (!turn) return nullptr;
  void* data = nullptr;
  const size_t padded = (std::max<size_t>(num_bytes, 1) + 255) / 256 * 256;
  const cudaStream_t stream = recording_ ? side_stream_ : stream_;
  cudaError_t error = cudaMallocAsync(&data, padded, stream);
  if (error == cudaErrorMemoryAllocation && !recording_) {
    cudaGetLastError();
    ReleaseFreed();  // the pool may keep blocks of sizes that do not fit
    error = cudaMallocAsync(&data, padded, stream);
  }
  if (error == cudaErrorMemoryAllocation) {
    cudaGetLastError();
    Fail({"CUDA: out of memory: " + std::to_string(num_bytes) + " bytes requested, " +
          std::to_string(bytes_in_use()) + " in use"});
    return nullptr;
  }
  Keep(error, "allocating");
  if (data == nullptr) return nullptr;
  Keep(cudaMemsetAsync(data, 0, padded, stream), "zeroing new memory");
  // The graph runs on stream_, which knows nothing of the side stream.
  if (recording_) Keep(cudaStreamSynchronize(side_stream_), "waiting for new memory");
  const std::lock_guard lock(use_->mutex);
  use_->blocks[data] = num_bytes;
  use_->bytes += num_bytes;
  use_->peak_bytes = std::max(use_->peak_bytes, use_->bytes);
  return data;
}

// Unlike ops it works after an error, so that buffers can be destroyed.
void CudaBackend::Free(void* data) {
  const std::lock_guard lock(mutex_);
  {
    const std::lock_guard use_lock(use_->mutex);
    const auto block = use_->blocks.find(data);
    if (block == use_->blocks.end()) return;
    use_->bytes -= block->second;
    use_->blocks.erase(block);
  }
  if (recording_) {
    freed_while_recording_.push_back(data);
    return;
  }
  cudaSetDevice(options_.device);
  Keep(cudaFreeAsync(data, stream_), "freeing");
}

void* CudaBackend::AllocatePinned(size_t num_bytes) {
  const Turn turn(*this);
  void* data = nullptr;
  if (turn) Keep(cudaMallocHost(&data, std::max<size_t>(num_bytes, 1)), "allocating pinned memory");
  return data;
}

void CudaBackend::FreePinned(void* data) {
  const std::lock_guard lock(mutex_);
  cudaSetDevice(options_.device);
  cudaStreamSynchronize(stream_);  // a copy to `data` may be under way
  Keep(cudaFreeHost(data), "freeing pinned memory");
}

size_t CudaBackend::bytes_in_use() const {
  const std::lock_guard lock(use_->mutex);
  return use_->bytes;
}

size_t CudaBackend::peak_bytes_in_use() const {
  const std::lock_guard lock(use_->mutex);
  return use_->peak_bytes;
}

DeviceMemory CudaBackend::memory() const {
  const std::lock_guard lock(mutex_);
  cudaSetDevice(options_.device);
  size_t free = 0, total = 0, pooled = 0, used = 0;
  cudaMemPool_t pool;
  if (cudaMemGetInfo(&free, &total) != cudaSuccess ||
      cudaDeviceGetDefaultMemPool(&pool, options_.device) != cudaSuccess ||
      cudaMemPoolGetAttribute(pool, cudaMemPoolAttrReservedMemCurrent, &pooled) != cudaSuccess ||
      cudaMemPoolGetAttribute(pool, cudaMemPoolAttrUsedMemCurrent, &used) != cudaSuccess) {
    cudaGetLastError();  // a lost device reports no memory
    return {};
  }
  // Memory that the pool keeps beyond what is in use, by any backend, is free for this process.
  const size_t kept = pooled > used ? pooled - used : 0;
  return {static_cast<int64_t>(free + kept), static_cast<int64_t>(total), false};
}

// The pool can give back only blocks whose free the stream has reached, so this waits first.
void CudaBackend::ReleaseFreed() {
  const Turn turn(*this);
  if (!turn || recording_) return;
  cudaMemPool_t pool;
  Keep(cudaStreamSynchronize(stream_), "waiting for the device");
  Keep(cudaDeviceGetDefaultMemPool(&pool, options_.device), "getting the memory pool");
  if (error_.empty()) Keep(cudaMemPoolTrimTo(pool, 0), "returning memory to the device");
}

int64_t CudaBackend::ScratchBytes(const ScratchSize& size) const {
  // The tile-entry capacity of a render is the number of entries at the last visit of the view and
  // a margin, see EntryRooms.
  const int64_t num_entries = size.num_entries + size.num_entries / 5;
  const RenderScratch s;
  const int64_t by_gaussian = BytesOfRow(s.cuda.gaussian_visible, s.visible_gaussian,
                                         s.visible_splat, s.visible_first_slot) +
                              (size.for_backward ? BytesOfRow(s.visible_grad) : 0);
  const int64_t by_entry = BytesOfRow(s.entry_visible, s.entry_slot, s.cuda.unsorted_slot,
                                      s.cuda.slot_visible, s.cuda.sort_keys, s.cuda.sort_keys) +
                           (size.for_backward ? kSlotSize * BytesOfRow(s.cuda.slot_sums) : 0);
  const int64_t by_tile =
      BytesOfRow(s.tile_first_entry, s.cuda.tile_first_bucket, s.cuda.tile_order) +
      (size.for_backward ? 4 * kTilePixels * BytesOfRow(s.cuda.pixel_color) : 0);
  const int64_t by_bucket =
      size.for_backward
          ? BytesOfRow(s.cuda.bucket_tile) + 4 * kTilePixels * BytesOfRow(s.cuda.bucket_color)
          : 0;
  // ImageLoss keeps three maps of gradients for each of three channels.
  constexpr int64_t kLossMaps = 9 * static_cast<int64_t>(sizeof(float));
  const int64_t by_pixel = BytesOfRow(s.pixel_transmittance, s.pixel_last_entry) + kLossMaps;
  // Histograms of the sorts, partial sums of the loss, and padding of the buffers.
  constexpr int64_t kFixed = 16 << 20;
  return WithReserve(
             by_gaussian * size.num_gaussians + by_entry * num_entries + by_tile * size.num_tiles +
             by_bucket * MaxBuckets(num_entries, size.num_tiles) + by_pixel * size.num_pixels) +
         kFixed;
}

}  // namespace pepeseg
