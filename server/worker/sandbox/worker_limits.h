#pragma once

#include <sys/types.h>

#include <cstdint>

#include "absl/status/status.h"

namespace pepeseg {

// Limits the resources of a worker, which decodes files from strangers: memory, CPU time, file
// size, open files, core dumps. `memory_limit`: bytes of private writable memory; 0: as much as the
// machine or the control group has (HostMemory). Builds with a sanitizer have no memory limit:
// sanitizers map more than any machine has.
absl::Status LimitResources(int64_t memory_limit, int num_threads);

// The same for a process that decodes one photograph: 2 GiB of memory, a minute of processor time,
// 128 MiB in a file.
absl::Status LimitPhotograph();

// Returns the memory limit that one of these set, bytes; 0: none.
int64_t MemoryLimit();

// Has the kernel kill this process when `parent` ends. CANCELLED: it has ended already.
absl::Status EndWithParent(pid_t parent);

// Lowers the priority of this process below the server's, and makes the kernel kill it before the
// server when memory runs out.
void YieldToServer();

}  // namespace pepeseg
