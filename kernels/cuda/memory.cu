#include <cuda_runtime.h>

#include <algorithm>
#include <string>

#include "kernels/cuda/cuda_backend.h"

// Memory of the CUDA backend. Device memory is allocated and freed in the order of the stream, from
// the device's default pool: a block that is freed here may be handed out again at once, and is
// used by the device only after the work that was queued before. Pinned memory is that of the host.

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
          std::to_string(bytes_in_use_) + " in use"});
    return nullptr;
  }
  Keep(error, "allocating");
  if (data == nullptr) return nullptr;
  Keep(cudaMemsetAsync(data, 0, padded, stream), "zeroing new memory");
  // The graph runs on stream_, which knows nothing of the side stream.
  if (recording_) Keep(cudaStreamSynchronize(side_stream_), "waiting for new memory");
  blocks_[data] = num_bytes;
  bytes_in_use_ += num_bytes;
  peak_bytes_ = std::max(peak_bytes_, bytes_in_use_);
  return data;
}

// Unlike ops it works after an error, so that buffers can be destroyed.
void CudaBackend::Free(void* data) {
  const std::lock_guard lock(mutex_);
  const auto block = blocks_.find(data);
  if (block == blocks_.end()) return;
  bytes_in_use_ -= block->second;
  blocks_.erase(block);
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
  const std::lock_guard lock(mutex_);
  return bytes_in_use_;
}

size_t CudaBackend::peak_bytes_in_use() const {
  const std::lock_guard lock(mutex_);
  return peak_bytes_;
}

DeviceMemory CudaBackend::memory() const {
  const std::lock_guard lock(mutex_);
  cudaSetDevice(options_.device);
  size_t free = 0, total = 0, pooled = 0;
  cudaMemPool_t pool;
  if (cudaMemGetInfo(&free, &total) != cudaSuccess ||
      cudaDeviceGetDefaultMemPool(&pool, options_.device) != cudaSuccess ||
      cudaMemPoolGetAttribute(pool, cudaMemPoolAttrReservedMemCurrent, &pooled) != cudaSuccess) {
    cudaGetLastError();  // a lost device reports no memory
    return {};
  }
  // Memory that the pool keeps beyond what is in use is free for this process.
  const size_t kept = pooled > bytes_in_use_ ? pooled - bytes_in_use_ : 0;
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

}  // namespace pepeseg
