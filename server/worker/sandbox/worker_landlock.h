#pragma once

#include "absl/status/status.h"
#include "server/worker/sandbox/worker_sandbox.h"

namespace pepeseg {

// The part of EnterSandbox that concerns files. Limits the files that this process and its children
// can open and, from Linux 6.12 on, the processes that they can signal to themselves. Call
// prctl(PR_SET_NO_NEW_PRIVS) before. FAILED_PRECONDITION: the kernel has no Landlock, or one older
// than Linux 5.19; nothing is limited. INTERNAL: the kernel refuses a rule.
absl::Status LimitFiles(const SandboxNeeds& needs);

}  // namespace pepeseg
