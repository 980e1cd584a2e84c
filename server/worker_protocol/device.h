#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "kernels/backend.h"

namespace pepeseg {

// A device that a process computes on, opened once at its start and passed down as a Backend&.
struct Device {
  // "cpu", "cpu:N", "cuda:N" or "cuda:N#K", with which another process can open the same device.
  std::string id;
  // Backend::name() with the numbers of the id: "cpu 1 (2 threads, AVX3)", "cuda 0 (NVIDIA H200)".
  std::string name;
  std::unique_ptr<Backend> backend;
  std::string reason;  // why "auto" or "all" chose the CPU; empty: it did not
};

// Opens a device. `wanted` is one of
//   auto    the first CUDA device if the build has CUDA and the device works, else the CPU
//   cpu     the CPU, with `num_threads` threads (0: one per core)
//   cpu:N   the CPU as logical device N, which computes as "cpu" does
//   cuda:N  a CUDA device; "cuda" is the same as "cuda:0"
// After "cuda:N", "#K" makes a further logical device of the same hardware, for tests.
// INVALID_ARGUMENT: `wanted` is another word. FAILED_PRECONDITION, with the reason: a CUDA device
// was named and is not available.
absl::StatusOr<Device> OpenDevice(const std::string& wanted, int num_threads);

// Opens the devices of a server, at least one. `list` is "all" (every CUDA device, or the CPU if
// none works) or words of OpenDevice, separated by commas. If `num_threads` is 0, CPU devices share
// the cores: see ThreadsOfDevice. INVALID_ARGUMENT: a word of the list is not a device, or is there
// twice, or the list has "auto" or "all" and another word. FAILED_PRECONDITION: see OpenDevice.
absl::StatusOr<std::vector<Device>> OpenDevices(const std::string& list, int num_threads);

// Returns the number of CPU threads of a job on one of `num_devices` devices: `num_threads`, or if
// that is 0 the cores divided by the devices, at least 1. For one device it returns `num_threads`.
int ThreadsOfDevice(int num_threads, int num_devices);

// Returns N for a Device::id "cuda:N" or "cuda:N#K", 0 for "cuda", and nothing for the CPU.
std::optional<int> CudaDevice(const std::string& id);

// Returns a Device::name without its numbers: "cuda (NVIDIA H200)". What was measured on one device
// holds for all of the same kind.
std::string KindOfDevice(const std::string& name);

}  // namespace pepeseg
