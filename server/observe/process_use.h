#pragma once

#include <cstdint>
#include <filesystem>

#include "absl/time/time.h"

namespace pepeseg {

// What this process takes of its machine just now; 0: not known.
struct ProcessUse {
  int64_t resident_bytes = 0;
  int num_descriptors = 0;
  int64_t max_descriptors = 0;
  int num_threads = 0;
  absl::Duration cpu_time;
};

ProcessUse MeasureProcess();

// Bytes that a process without privileges may still write to the file system of `folder`; -1: it
// cannot be told.
int64_t DiskFreeBytes(const std::filesystem::path& folder);

}  // namespace pepeseg
