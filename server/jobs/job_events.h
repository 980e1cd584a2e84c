#pragma once

#include <string>

#include "absl/status/status.h"
#include "server/store/rows.h"
#include "server/worker_protocol/job_folder.h"

// Events that the supervisor appends to a job's log: the state RUNNING before the worker's events,
// every other state and warnings after them.
namespace pepeseg {

// Appends the event of a job's new state.
absl::Status AppendState(const JobFolder& folder, const JobRow& job);
absl::Status AppendWarning(const JobFolder& folder, const JobRow& job, const std::string& message);

}  // namespace pepeseg
