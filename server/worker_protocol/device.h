#pragma once

#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "kernels/backend.h"

namespace pepeseg {

// The device that a process computes on, chosen once at its start and passed down as a Backend&.
struct Device {
  std::string id;  // "cpu" or "cuda:N", with which another process can open the same device
  std::unique_ptr<Backend> backend;
  std::string reason;  // why "auto" chose the CPU; empty: it did not
};

// Opens a device. `wanted` is one of
//   auto    the first CUDA device if the build has CUDA and the device works, else the CPU
//   cpu     the CPU, with `num_threads` threads (0: one per core)
//   cuda:N  a CUDA device; "cuda" is the same as "cuda:0"
// INVALID_ARGUMENT: `wanted` is another word. FAILED_PRECONDITION, with the reason: a CUDA device
// was named and is not available.
absl::StatusOr<Device> OpenDevice(const std::string& wanted, int num_threads);

// Returns N for a Device::id "cuda:N", 0 for "cuda", and nothing for "cpu".
std::optional<int> CudaDevice(const std::string& id);

}  // namespace pepeseg
