#include "server/jobs/job_events.h"

#include <spdlog/spdlog.h>

#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/scene_ref.h"
#include "server/worker_protocol/event_log.h"

namespace pepeseg {
namespace {

v1::JobState ToProto(JobState state) {
  // Both enums have the same order; the proto's starts at 1.
  return static_cast<v1::JobState>(static_cast<int>(state) + 1);
}
static_assert(v1::JOB_STATE_QUEUED == static_cast<int>(JobState::kQueued) + 1);
static_assert(v1::JOB_STATE_CANCELLED == static_cast<int>(JobState::kCancelled) + 1);

// The log of each attempt has a part that the server writes before the worker, one of the worker,
// and one of the server after it, so that no file has two writers.
absl::Status AppendEvent(const JobFolder& folder, const JobRecord& job, EventPart part,
                         v1::JobEvent event) {
  RETURN_IF_ERROR(folder.Make());
  ASSIGN_OR_RETURN(const std::unique_ptr<EventLogWriter> log,
                   EventLogWriter::Open(folder.events(), job.fence, part));
  return log->Append(std::move(event));
}

}  // namespace

absl::StatusOr<v1::JobState> ReadNewestState(const JobFolder& folder) {
  v1::JobState newest = v1::JOB_STATE_UNSPECIFIED;
  EventLogReader log(folder.events());
  while (true) {
    const absl::StatusOr<std::vector<v1::JobEvent>> events = log.Read();
    // A damaged log must not keep the server from starting; the store has the state.
    if (absl::IsDataLoss(events.status())) {
      spdlog::error("jobs/{}: {}", folder.path().filename().string(), events.status().ToString());
      return newest;
    }
    RETURN_IF_ERROR(events.status());
    if (events->empty()) return newest;
    for (const v1::JobEvent& event : *events) {
      if (event.has_state_changed()) newest = event.state_changed().state();
    }
  }
}

absl::Status AppendWarning(const JobFolder& folder, const JobRecord& job,
                           const std::string& message) {
  v1::JobEvent event;
  event.mutable_warning()->set_message(message);
  return AppendEvent(folder, job, EventPart::kAfter, std::move(event));
}

absl::Status AppendState(const JobFolder& folder, const JobRecord& job) {
  v1::JobEvent event;
  v1::JobEvent::StateChanged& change = *event.mutable_state_changed();
  change.set_state(ToProto(job.state));
  if (job.state == JobState::kFailed) {
    change.mutable_error()->set_code(job.error_code);
    change.mutable_error()->set_message(job.error_message);
    change.mutable_error()->set_reason(
        absl::StatusCodeToString(static_cast<absl::StatusCode>(job.error_code)));
  }
  if (job.model != 0) {
    change.set_model(ChildName(job.scene, "models", job.model));
  }
  const bool begins = job.state == JobState::kRunning;
  return AppendEvent(folder, job, begins ? EventPart::kBefore : EventPart::kAfter,
                     std::move(event));
}

}  // namespace pepeseg
