#include "kernels/cpu/cpu_backend.h"

#include <malloc.h>
#include <sys/mman.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>

#include "kernels/buffer.h"
#include "kernels/host_memory.h"

namespace pepeseg {
namespace {

// Each block is preceded by its size, in a cache line of its own.
constexpr size_t kHeaderBytes = 64;
// Blocks of at least two huge pages ask for them. About a hundred planes of Gaussians are walked at
// a time, more than the TLB has entries for small pages.
constexpr size_t kHugePage = size_t{1} << 21;

// Returns zero-filled memory, aligned to a cache line or a huge page, or nullptr.
std::byte* AllocateZeros(size_t num_bytes) {
  const bool huge = num_bytes >= 2 * kHugePage;
  const size_t align = huge ? kHugePage : kHeaderBytes;
  const size_t total = (num_bytes + align - 1) / align * align;
  void* block = std::aligned_alloc(align, total);
  if (block == nullptr) return nullptr;
#ifdef MADV_HUGEPAGE
  if (huge) madvise(block, total, MADV_HUGEPAGE);  // only advice, so errors are ignored
#endif
  std::memset(block, 0, num_bytes);
  return static_cast<std::byte*>(block);
}

}  // namespace

CpuBackend::CpuBackend(int num_threads) : pool_(num_threads), simd_(BestSimdKernels()) {}

std::string CpuBackend::name() const {
  const int num_threads = pool_.num_threads();
  return "cpu (" + std::to_string(num_threads) + (num_threads == 1 ? " thread, " : " threads, ") +
         simd_.name + ")";
}

std::string CpuBackend::error() const {
  const std::lock_guard lock(error_mutex_);
  return error_.what;
}

// Ops are done when they return, so there is nothing to wait for.
BackendError CpuBackend::TakeError() {
  const std::lock_guard lock(error_mutex_);
  BackendError error = error_;
  if (!error_.fatal) {
    error_ = {};
    failed_ = false;
  }
  return error;
}

// failed_ is set under the lock, so that TakeError cannot clear it between the two writes.
void CpuBackend::Fail(const BackendError& error) {
  const std::lock_guard lock(error_mutex_);
  if (error_.what.empty()) error_ = error;
  failed_ = true;
}

void* CpuBackend::Allocate(size_t num_bytes) {
  std::byte* block = AllocateZeros(kHeaderBytes + (num_bytes + 63) / 64 * 64);
  if (block == nullptr) {
    Fail({"out of memory: no " + std::to_string(num_bytes) + " bytes"});
    return nullptr;
  }
  std::memcpy(block, &num_bytes, sizeof(num_bytes));
  const size_t now = bytes_in_use_ += num_bytes;
  // Raises the peak without a lock; other threads allocate meanwhile.
  size_t peak = peak_bytes_;
  while (now > peak && !peak_bytes_.compare_exchange_weak(peak, now)) {
  }
  return block + kHeaderBytes;
}

// The size in the header keeps bytes_in_use right without a table of blocks.
void CpuBackend::Free(void* data) {
  if (data == nullptr) return;
  std::byte* block = static_cast<std::byte*>(data) - kHeaderBytes;
  size_t num_bytes;
  std::memcpy(&num_bytes, block, sizeof(num_bytes));
  bytes_in_use_ -= num_bytes;
  std::free(block);
}

void CpuBackend::CopyFromHost(void* to, const void* from_host, size_t num_bytes) {
  std::memcpy(to, from_host, num_bytes);
}
void CpuBackend::CopyToHost(void* to_host, const void* from, size_t num_bytes) {
  std::memcpy(to_host, from, num_bytes);
}
void CpuBackend::Copy(void* to, const void* from, size_t num_bytes) {
  std::memmove(to, from, num_bytes);
}
void CpuBackend::Zero(void* data, size_t num_bytes) { std::memset(data, 0, num_bytes); }

DeviceMemory CpuBackend::memory() const { return HostMemory(); }

// Returns free pages of the heap to the system; no-op without glibc.
void CpuBackend::ReleaseFreed() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

// Counts the buffers of a RenderScratch. Temporary vectors of the ops are not counted.
int64_t CpuBackend::ScratchBytes(const ScratchSize& size) const {
  const RenderScratch s;
  const int64_t by_gaussian =
      BytesOfRow(s.candidate_gaussian, s.candidate_splat, s.candidate_num_tiles,
                 s.candidate_num_runs, s.visible_gaussian, s.visible_splat, s.visible_first_slot,
                 s.visible_first_run, s.sort_keys, s.sort_keys) +
      (size.for_backward ? BytesOfRow(s.visible_grad) : 0);
  // A run covers at least one entry, so there are at most as many runs.
  const int64_t by_entry = BytesOfRow(s.entry_visible, s.entry_slot, s.runs) +
                           (size.for_backward ? BytesOfRow(s.slot_grad, s.entry_blocks) : 0);
  const int64_t by_tile = BytesOfRow(s.tile_first_entry);
  const int64_t by_pixel = BytesOfRow(s.pixel_transmittance, s.pixel_last_entry);
  constexpr int64_t kFixed = 4096;  // counters and the ends of prefix sums
  return WithReserve(by_gaussian * size.num_gaussians + by_entry * size.num_entries +
                     by_tile * size.num_tiles + by_pixel * size.num_pixels) +
         kFixed;
}

std::unique_ptr<Backend> MakeCpuBackend(int num_threads) {
  return std::make_unique<CpuBackend>(num_threads);
}

}  // namespace pepeseg
