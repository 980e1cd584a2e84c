#pragma once

#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "clients/cpp/client.h"
#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg::client::cli {

// Called once for each event of a watched job except heartbeats.
using EventFn = absl::FunctionRef<void(const v1::JobEvent&)>;

// Follows a job to its end, with progress on standard error, and returns the job if it succeeded.
// Resumes after a lost connection as Client::WatchJob does, without missing an event. A job that
// failed or was cancelled is an error of JobFailed or JobCancelled.
absl::StatusOr<v1::Job> WatchJob(const Client& client, const std::string& job, EventFn on_event);

}  // namespace pepeseg::client::cli
