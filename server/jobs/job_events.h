#pragma once

#include <string>

#include "absl/status/status.h"
#include "server/store/rows.h"
#include "server/worker_protocol/job_folder.h"

// What the supervisor adds to the log of a job's attempt: RUNNING before there is a worker, every
// other state, and warnings, after its end.
namespace pepeseg {

// The event that tells of a job's new state.
absl::Status AppendState(const JobFolder& folder, const JobRow& job);
absl::Status AppendWarning(const JobFolder& folder, const JobRow& job, const std::string& message);

}  // namespace pepeseg
