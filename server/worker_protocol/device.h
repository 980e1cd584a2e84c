#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "kernels/backend.h"

namespace pepeseg {

// The device that a process computes on, picked once at its start and handed down as a Backend&.
struct Device {
  std::string id;  // "cpu" or "cuda:N": what OpenDevice takes to open the same one elsewhere
  std::unique_ptr<Backend> backend;
  std::string reason;  // why "auto" took the CPU; empty: CUDA, or it was asked for
};

// `wanted`: "auto" (the first CUDA device where the build has CUDA and a device answers, else the
// CPU), "cpu", "cuda" (as "cuda:0") or "cuda:N". INVALID_ARGUMENT: another word.
// FAILED_PRECONDITION, with the reason: CUDA was asked for by name and cannot be had.
// num_threads, of the CPU: 0: as many as the machine has.
absl::StatusOr<Device> OpenDevice(const std::string& wanted, int num_threads);

}  // namespace pepeseg
