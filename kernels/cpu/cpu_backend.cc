#include "kernels/cpu/cpu_backend.h"

#include <cstdlib>
#include <cstring>
#include <string>

namespace pepeseg {
namespace {

// Ahead of every block stands its size, in a cache line of its own.
constexpr size_t kHeaderBytes = 64;

}  // namespace

CpuBackend::CpuBackend(int num_threads) : pool_(num_threads), simd_(BestSimdKernels()) {}

std::string CpuBackend::name() const {
  const int num_threads = pool_.num_threads();
  return "cpu (" + std::to_string(num_threads) + (num_threads == 1 ? " thread, " : " threads, ") +
         simd_.name + ")";
}

void* CpuBackend::Allocate(size_t num_bytes) {
  const size_t total = kHeaderBytes + (num_bytes + 63) / 64 * 64;
  auto* block = static_cast<std::byte*>(std::aligned_alloc(64, total));
  if (block == nullptr) return nullptr;
  std::memset(block, 0, total);
  std::memcpy(block, &num_bytes, sizeof(num_bytes));
  bytes_in_use_ += num_bytes;
  return block + kHeaderBytes;
}

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
