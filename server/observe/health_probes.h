#pragma once

#include <cstdint>
#include <filesystem>

#include "absl/status/status.h"
#include "kernels/backend.h"

namespace pepeseg {

// Under so much, uploads and trainings have no place to write to.
inline constexpr int64_t kMinDiskFreeBytes = int64_t{256} << 20;

// Whether the folder takes a small file, to the disk, and its file system has over so much free:
// else RESOURCE_EXHAUSTED, or the error of the file.
absl::Status ProbeDisk(const std::filesystem::path& folder, int64_t min_free_bytes);

// INTERNAL: the device has an error that stays.
absl::Status ProbeDevice(const Backend& backend);

}  // namespace pepeseg
