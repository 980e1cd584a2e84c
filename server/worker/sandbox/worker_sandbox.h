#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/status.h"

namespace pepeseg {

// What a process that decodes uploaded files may use besides memory and CPU. One that decodes a
// single file needs `{.reads = {file}}`.
struct SandboxNeeds {
  // Folders below which it reads and writes files. It cannot create links, sockets, FIFOs or
  // devices there.
  std::vector<std::filesystem::path> writes = {};
  // Files, and folders with everything below them, that it reads.
  std::vector<std::filesystem::path> reads = {};
  // Whether it starts programs: those of the system (/usr), and `programs`, files and folders that
  // it may also read.
  bool runs_programs = false;
  std::vector<std::filesystem::path> programs = {};
  // Whether it uses CUDA: libraries and devices of the driver, /sys, pinned memory.
  bool has_device = false;
};

// Limits this process, and every process that it starts. The limits cannot be lifted, and the
// process can gain no privileges.
//
// System calls (seccomp): those of a list (worker_sandbox.cc). Every other one fails with
// EPERM, and the kernel's log names it. Calls that only an attack makes kill the process (SIGSYS).
// There is no network, no connection to a local socket of another process, no links, and no exec
// unless `runs_programs`.
//
// Files (Landlock; where the kernel has none, a warning is logged and files are not limited): reads
// the system's libraries, a few files about the machine and itself, and what `needs` names. Writes
// below `needs.writes`, to /dev/null, /dev/zero and /dev/full, and to CUDA's devices and cache. A
// path that does not exist when this is called is not allowed. Names, sizes and times of files
// (stat) are not hidden.
//
// Call it while the process has one thread. INTERNAL: the kernel has no seccomp, or refuses it.
absl::Status EnterSandbox(const SandboxNeeds& needs);

}  // namespace pepeseg
