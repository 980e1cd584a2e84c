#pragma once

#include "absl/status/status.h"
#include "server/jobs/worker_sandbox.h"

namespace pepeseg {

// The part of the sandbox that is about files: from now on this process and what it starts write
// only where EnterSandbox says, and signal nobody else where the kernel can tell (Linux 6.12).
// FAILED_PRECONDITION: the kernel has no Landlock of Linux 5.19 or later, and nothing was limited;
// the message says what is missing. INTERNAL: it has, and refuses. Before: PR_SET_NO_NEW_PRIVS.
absl::Status LimitWrites(const SandboxNeeds& needs);

}  // namespace pepeseg
