#include "kernels/cpu/cpu_backend.h"

#include <sys/mman.h>

#include <cstdlib>
#include <cstring>
#include <string>

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

std::unique_ptr<Backend> MakeCpuBackend(int num_threads) {
  return std::make_unique<CpuBackend>(num_threads);
}

}  // namespace pepeseg
