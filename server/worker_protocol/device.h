#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "kernels/backend.h"

namespace pepeseg {

// The device that a process computes on, chosen once at its start and passed down as a Backend&.
struct Device {
  std::string id;  // "cpu" or "cuda:N": OpenDevice opens the same device by it in another process
  std::unique_ptr<Backend> backend;
  std::string reason;  // why "auto" chose the CPU; empty: CUDA, or the CPU was asked for
};

// `wanted`: "auto" (the first CUDA device if the build has CUDA and the device works, else the
// CPU), "cpu", "cuda" (the same as "cuda:0") or "cuda:N". `num_threads`: of the CPU; 0: as many as
// the machine has. INVALID_ARGUMENT: another word. FAILED_PRECONDITION, with the reason: CUDA was
// asked for by name and is not available.
absl::StatusOr<Device> OpenDevice(const std::string& wanted, int num_threads);

}  // namespace pepeseg
