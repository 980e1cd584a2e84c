#pragma once

#include <sys/types.h>

#include <cstdint>

#include "absl/status/status.h"

namespace pepeseg {

// What keeps a worker, which decodes files that nobody has vouched for, from hurting its machine.
// `memory_limit`: bytes of private writable memory; 0: as much as the machine has for this process
// (HostMemory). Sanitizers map more than any machine has, so built with one there is no such limit.
absl::Status LimitResources(int64_t memory_limit, int num_threads);

// The same for a process that decodes one photograph: 2 GiB of memory, a minute of processor time,
// 128 MiB in a file.
absl::Status LimitPhotograph();

// The limit of memory that one of these set, bytes; 0: none.
int64_t MemoryLimit();

// The worker is killed when `parent` ends; CANCELLED when it has already.
absl::Status EndWithParent(pid_t parent);

// Queries of the server come first, and the kernel out of memory takes a worker before the server.
void YieldToServer();

}  // namespace pepeseg
