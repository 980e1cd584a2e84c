#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/job_service.pb.h"
#include "server/store/records.h"
#include "server/worker_protocol/job_folder.h"

// The server's own events in a job's log: the state RUNNING before the worker's events, every other
// state and warnings after them. Each function opens the log again. The caller must hold the job,
// since a part of a log has one writer.
namespace pepeseg {

// Appends an event with the job's state; with the error of a job that has FAILED, and the name of a
// new model.
absl::Status AppendState(const JobFolder& folder, const JobRecord& job);
// Appends a warning after the worker's events.
absl::Status AppendWarning(const JobFolder& folder, const JobRecord& job,
                           const std::string& message);

// Returns the newest state in the log; JOB_STATE_UNSPECIFIED: it has none. Stops at a broken record
// and logs it. INTERNAL: the disk failed.
absl::StatusOr<v1::JobState> ReadNewestState(const JobFolder& folder);

}  // namespace pepeseg
