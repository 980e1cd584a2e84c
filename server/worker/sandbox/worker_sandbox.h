#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/status.h"

namespace pepeseg {

// What a process that decodes uploaded files may use beyond memory and CPU. A process that only
// decodes one file needs `{.reads = {file}}`.
struct SandboxNeeds {
  // Folders below which it reads and writes. It cannot make links, sockets, FIFOs or devices there.
  std::vector<std::filesystem::path> writes = {};
  // Files, and folders with everything below them, that it only reads.
  std::vector<std::filesystem::path> reads = {};
  // Whether it starts programs: those of the system (/usr), and these files and folders, which it
  // may read, too.
  bool runs_programs = false;
  std::vector<std::filesystem::path> programs = {};
  // Whether it uses CUDA: the driver's libraries and devices, /sys, pinned memory.
  bool has_device = false;
};

// Limits this process, and every process that it starts, for good. It cannot be undone, and no new
// privileges can be gained.
//
// System calls (seccomp): those of a list (worker_system_calls.h). Every other one is refused as
// EPERM, and the kernel's log names it; calls that only an attack makes kill the process (SIGSYS).
// There is no network, no connection to a local socket of another process, no links, and no exec
// unless `runs_programs`.
//
// Files (Landlock, where the kernel has it; the log says when not): reads the system's libraries,
// a few files about the machine and itself, and what `needs` names; writes below `needs.writes`, to
// /dev/null and its like, and to CUDA's devices and cache. What does not exist when this is called
// is not allowed. Names, sizes and times of files (stat) are not hidden.
//
// Called while the process has one thread. INTERNAL: the kernel has no seccomp, or refuses it.
absl::Status EnterSandbox(const SandboxNeeds& needs);

}  // namespace pepeseg
