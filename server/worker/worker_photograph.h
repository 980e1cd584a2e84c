#pragma once

#include <string>

#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

// Runs one PhotographTask: reads the image from standard input and writes the answer to standard
// output (photograph_task.h). Limits this process's memory, CPU time and size of the answer
// (LimitPhotograph) and, if `sandbox`, enters a sandbox that names no files. kSucceeded: an answer
// was written, which may be an error. kFailed: it could not be written. kBadSpec: `task` is not a
// task, or the limits cannot be set.
WorkerExit RunPhotographTask(const std::string& task, bool sandbox);

}  // namespace pepeseg
