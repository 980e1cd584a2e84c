#pragma once

#include <cstdint>
#include <filesystem>

#include "absl/time/time.h"

namespace pepeseg {

// Resources that this process uses at the moment. 0: not known.
struct ProcessUse {
  int64_t resident_bytes = 0;
  int num_descriptors = 0;      // open file descriptors
  int64_t max_descriptors = 0;  // limit of them; 0 also if there is no limit
  int num_threads = 0;
  absl::Duration cpu_time;
};

ProcessUse MeasureProcess();

// Returns the bytes that a process without privileges may still write to the file system of
// `folder`, or -1 on an error.
int64_t DiskFreeBytes(const std::filesystem::path& folder);

}  // namespace pepeseg
