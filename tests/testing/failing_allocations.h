#pragma once

#include <cstdlib>

// Lets allocations of the CPU backend fail, in the whole program: to be included by one file of it.
namespace {

constexpr int kUnlimited = -1;
int allocations_left = kUnlimited;  // allocations that still succeed

}  // namespace

// Replaces the C library's function, by which the CPU backend allocates.
extern "C" void* aligned_alloc(size_t alignment, size_t size) {
  if (allocations_left == 0) return nullptr;
  if (allocations_left > 0) --allocations_left;
  void* block = nullptr;
  return posix_memalign(&block, alignment, size) == 0 ? block : nullptr;
}
