#pragma once

#include "absl/status/status.h"
#include "server/worker/sandbox/worker_sandbox.h"

namespace pepeseg {

// The part of the sandbox that is about files: from now on this process and what it starts open
// only what EnterSandbox says, and signal nobody else where the kernel can tell (Linux 6.12).
// FAILED_PRECONDITION: the kernel has no Landlock of Linux 5.19 or later, and nothing was limited.
// INTERNAL: it has, and refuses. Call prctl(PR_SET_NO_NEW_PRIVS) before.
absl::Status LimitFiles(const SandboxNeeds& needs);

}  // namespace pepeseg
