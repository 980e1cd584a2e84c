#pragma once

#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "kernels/backend.h"
#include "tests/bench/bench_clock.h"

namespace pepeseg {

// Returns the CPU backend for "cpu" (num_threads 0: all cores), otherwise the CUDA backend, which
// fills `times` if that is not null. Without a CUDA device prints the reason to standard error and
// returns null.
inline std::unique_ptr<Backend> MakeBenchBackend(const std::string& device, int num_threads,
                                                 std::vector<KernelTime>* times) {
  if (device == "cpu") return MakeCpuBackend(num_threads);
  std::string error;
  auto backend = MakeCudaBackend({.kernel_times = times}, &error);
  if (backend == nullptr) std::cerr << error << "\n";
  return backend;
}

}  // namespace pepeseg
