#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/status.h"

namespace pepeseg {

// What a process that decodes uploaded files needs beyond computing. For a process that only
// decodes one file: `{.reads = {file}}`.
struct SandboxNeeds {
  // Folders: it reads and writes what is below them. It makes no links, sockets, FIFOs or devices.
  std::vector<std::filesystem::path> writes = {};
  // Files, and folders with all that is below them, which it only reads.
  std::vector<std::filesystem::path> reads = {};
  // Starts programs: those of the system (/usr), and these files and folders, which it reads, too.
  bool runs_programs = false;
  std::vector<std::filesystem::path> programs = {};
  // Uses CUDA: the driver's libraries and devices, /sys, pinned memory.
  bool has_device = false;
};

// Limits this process, and every process that it starts, for good. There is no way back, and no way
// to new privileges.
//
// System calls (seccomp): those of a list (worker_system_calls.h). Every other one is refused as
// EPERM, and the kernel's log names it; those that only an attack makes kill the process (SIGSYS).
// No network, and no connection to a local socket of anybody else. No links. No exec unless
// `runs_programs`.
//
// Files (Landlock, where the kernel has it; the log says when not): reads the system's libraries,
// a few files about the machine and itself, and what `needs` names; writes below `needs.writes`, to
// /dev/null and its like, and to CUDA's devices and cache. What does not exist when this is called
// is not allowed. Names, sizes and times of files (stat) are not hidden.
//
// Called while the process has one thread. INTERNAL: the kernel has no seccomp, or refuses it.
absl::Status EnterSandbox(const SandboxNeeds& needs);

}  // namespace pepeseg
