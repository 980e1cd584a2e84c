#pragma once

#include <string>

#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

// Runs one PhotographTask from standard input to standard output, under limits of its own (memory,
// processor time, size of the answer) and, unless `sandbox` is false, in a sandbox that opens no
// file at all. kSucceeded: an answer was written, which may be an error. kBadSpec: `task` is not a
// task.
WorkerExit RunPhotographTask(const std::string& task, bool sandbox);

}  // namespace pepeseg
