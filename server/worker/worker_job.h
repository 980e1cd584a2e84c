#pragma once

#include <atomic>

#include "absl/status/statusor.h"
#include "core/train/train.h"
#include "server/worker_protocol/event_log.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

// The only data that the handler of SIGTERM touches.
struct StopSwitch {
  std::atomic<bool> stop = false;    // the handler sets it: the job ends at the next step
  std::atomic<bool> polled = false;  // the job sets it while it looks at `stop` at each step
};
static_assert(std::atomic<bool>::is_always_lock_free);

// One attempt of a job. The references must outlive it.
struct WorkerJob {
  const JobFolder& folder;
  const JobSpec& spec;
  EventLogWriter& log;
  StopSwitch& stop;
};

// Returns what the job trains from: its files, its folders, and the tools of this machine.
// INVALID_ARGUMENT: a file has an unknown kind.
absl::StatusOr<TrainingInputs> TrainingInputsOf(const JobFolder& folder, const JobSpec& spec);

// Trains (core/train/train.h), writes the job's events meanwhile, and returns the result. If its
// status is OK, the model is in folder.attempt(spec.fence).
JobResult RunWorkerJob(const WorkerJob& job);

}  // namespace pepeseg
