#pragma once

#include <string>

#include "kernels/backend.h"

namespace pepeseg {

// Returns the memory of the machine that this process may use: total and free memory are each the
// least of the machine's own and those of its control group (version 1 or 2), as in a container,
// and of all groups above it. Linux only: both are INT64_MAX where nothing can be read. `root` is
// the file system with /proc and /sys, for tests.
DeviceMemory HostMemory(const std::string& root = "");

}  // namespace pepeseg
