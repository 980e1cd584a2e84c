#pragma once

#include <sys/types.h>

#include <cstdint>

#include "absl/status/status.h"

namespace pepeseg {

// Whether this is a build with AddressSanitizer or ThreadSanitizer. They map more memory than any
// machine has and trace other threads, so such a build has no memory limit and a wider filter of
// system calls.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif
#else
inline constexpr bool kSanitized = false;
#endif

// Limits the resources of this process, a worker that decodes files from strangers: memory, CPU
// time, file size, open files, core dumps. `memory_limit`: bytes of private writable memory; 0: all
// memory of the machine or control group (HostMemory). `num_threads`: threads that compute; 0: one
// per core. The CPU time is a week for each of them. Limits that are already lower stay. INTERNAL:
// the kernel refused.
absl::Status LimitResources(int64_t memory_limit, int num_threads);

// Limits a process that decodes one photograph: 2 GiB of memory, a minute of CPU time, files
// of 128 MiB.
absl::Status LimitPhotograph();

// Returns the memory limit of this process, bytes. 0: it has none.
int64_t MemoryLimit();

// Has the kernel kill this process when the thread of `parent` that launched it ends. CANCELLED:
// `parent` has ended already.
absl::Status EndWithParent(pid_t parent);

// Lowers the priority of this process below the server's, and makes the kernel kill it before the
// server when memory runs out.
void YieldToServer();

}  // namespace pepeseg
