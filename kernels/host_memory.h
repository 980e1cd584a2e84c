#pragma once

#include <string>

#include "kernels/backend.h"

namespace pepeseg {

// The memory that this process may have of its machine: the machine's own, or the limit of the
// control group (version 1 or 2) that it is in, or of one above that, whichever is less, as in a
// container. `root`: of the file system with /proc and /sys, for tests.
DeviceMemory HostMemory(const std::string& root = "");

}  // namespace pepeseg
