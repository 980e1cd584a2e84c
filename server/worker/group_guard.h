#pragma once

#include "absl/status/status.h"

namespace pepeseg {

// Makes this process the leader of a process group, unless it is one, and starts a process that
// kills this group when this process has ended, however that happened. Thus no program of a job
// outlives its worker, nor do the programs that it has started. The sandbox keeps programs in the
// group. Call before the sandbox is entered and before threads are started. INTERNAL: the process
// cannot be started.
absl::Status GuardGroup();

}  // namespace pepeseg
