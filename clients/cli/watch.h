#pragma once

#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "clients/cpp/client.h"
#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg::client::cli {

// Sees every event of a watched job, heartbeats left out.
using EventFn = absl::FunctionRef<void(const v1::JobEvent&)>;

// Follows a job to its end, with progress on standard error; reconnects for half a minute when the
// server goes away, and misses nothing. Returns the ended job; its own failure or cancellation is
// an error with that exit code.
absl::StatusOr<v1::Job> WatchJob(const Client& client, const std::string& job, EventFn on_event);

}  // namespace pepeseg::client::cli
