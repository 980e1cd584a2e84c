#pragma once

#include <sys/resource.h>

#include <chrono>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "kernels/backend.h"

namespace pepeseg {

// "cpu" (num_threads 0: all) or a CUDA device, which fills `times` where that is not null. Null,
// and why on standard error, without such a device.
inline std::unique_ptr<Backend> MakeBenchBackend(const std::string& device, int num_threads,
                                                 std::vector<KernelTime>* times) {
  if (device == "cpu") return MakeCpuBackend(num_threads);
  std::string error;
  auto backend = MakeCudaBackend({.kernel_times = times}, &error);
  if (backend == nullptr) std::cerr << error << "\n";
  return backend;
}

// Seconds from some beginning.
inline double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Likewise, of all cores together: what a machine that does other things, too, leaves as it is.
inline double CoreNow() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace pepeseg
