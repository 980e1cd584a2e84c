#pragma once

#include <string>

#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

// Runs the operator's program for a text, inside the limits and the sandbox of a job: it reads the
// photographs of its folder, and writes below its answers only. The program's output goes to
// TextLog. What went wrong goes to standard error, in one line.
WorkerExit RunTextTask(const std::string& task);

}  // namespace pepeseg
