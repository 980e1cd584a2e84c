#pragma once

#include <sys/resource.h>

#include <chrono>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "kernels/backend.h"

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

// Returns the wall clock, seconds from an arbitrary start.
inline double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Returns the processor time of this process, seconds summed over all cores. Other programs on the
// machine hardly affect it.
inline double CoreNow() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace pepeseg
