#pragma once

#include "absl/status/status.h"
#include "server/worker/sandbox/worker_sandbox.h"

namespace pepeseg {

// Limits the files that this process and those that it starts can open to what EnterSandbox says,
// and, from Linux 6.12 on, their signals to each other. FAILED_PRECONDITION: the kernel has no
// Landlock of Linux 5.19 or later, and nothing was limited. INTERNAL: it has, but refuses. Call
// prctl(PR_SET_NO_NEW_PRIVS) before.
absl::Status LimitFiles(const SandboxNeeds& needs);

}  // namespace pepeseg
