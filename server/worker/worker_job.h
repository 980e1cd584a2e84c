#pragma once

#include <atomic>

#include "absl/status/statusor.h"
#include "core/train/training_inputs.h"
#include "server/worker_protocol/event_log.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

// What a signal handler may touch.
struct StopSwitch {
  std::atomic<bool> stop = false;    // set by the handler: end at the next step
  std::atomic<bool> polled = false;  // set by the job: it looks at `stop` from time to time
};
static_assert(std::atomic<bool>::is_always_lock_free);

struct WorkerJob {
  const JobFolder& folder;
  const JobSpec& spec;
  EventLogWriter& log;
  StopSwitch& stop;
};

// What the job trains from: its files, its folders, and the tools of this machine.
// INVALID_ARGUMENT: a file of unknown kind.
absl::StatusOr<TrainingInputs> TrainingInputsOf(const JobFolder& folder, const JobSpec& spec);

// Trains (core/train/train.h), writes the job's events on the way, and returns its result. When the
// result's status is OK, the model is in folder.attempt(spec.fence).
JobResult RunWorkerJob(const WorkerJob& job);

}  // namespace pepeseg
