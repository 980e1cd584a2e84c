#pragma once

#include <filesystem>

#include "absl/status/status.h"

namespace pepeseg {

// What a job needs beyond reading files and computing.
struct SandboxNeeds {
  std::filesystem::path folder;  // the job's: what it may write below
  bool runs_programs = false;    // COLMAP, or a priors command
  bool has_device = false;       // CUDA's driver: its devices, sockets, pinned memory
};

// From now on this process and what it starts cannot do what no worker does, whatever a file that
// it decodes makes of it. System calls (seccomp): those of a list, every other is refused as EPERM,
// and the kernel's log names it; those that only an attack would make kill the process (SIGSYS).
// No network: sockets are local ones, and those only where a device or a program needs them. No
// exec unless `runs_programs`. Files (Landlock, where the kernel has it; the log says when not):
// reading everywhere, writing below `folder`, below TMPDIR (/tmp where that is not set), and to
// the devices and caches that are needed. There is no way back, and no way to new privileges.
//
// Called while the process has one thread. INTERNAL: the kernel has no seccomp, or refuses it.
absl::Status EnterSandbox(const SandboxNeeds& needs);

}  // namespace pepeseg
