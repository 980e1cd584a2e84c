// A client's calls about jobs.
#include <chrono>
#include <optional>
#include <thread>

#include "clients/cpp/ask.h"
#include "clients/cpp/client.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client {
namespace {

using Jobs = v1::JobService::Stub;

constexpr int kRetries = 10;
constexpr auto kRetryPause = std::chrono::seconds(3);

bool HasEnded(v1::JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED ||
         state == v1::JOB_STATE_CANCELLED;
}

struct Watched {
  std::optional<int64_t> sequence;  // of the last event seen
  bool ended = false;
};

// One stream, to its end.
absl::Status WatchOnce(Jobs& jobs, const std::string& job, Watched& watched,
                       absl::FunctionRef<void(const v1::JobEvent&)> on_event) {
  v1::WatchJobRequest request;
  request.set_name(job);
  if (watched.sequence) request.set_after_sequence(*watched.sequence);
  Call call("", 0);
  auto stream = jobs.WatchJob(call, request);
  v1::JobEvent event;
  while (stream->Read(&event)) {
    watched.sequence = event.sequence();
    if (event.event_case() == v1::JobEvent::kHeartbeat) continue;
    watched.ended |= event.event_case() == v1::JobEvent::kStateChanged &&
                     HasEnded(event.state_changed().state());
    watched.ended |=
        event.event_case() == v1::JobEvent::kSnapshot && HasEnded(event.snapshot().state());
    on_event(event);
  }
  return FromGrpc(stream->Finish());
}

bool IsAway(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status);
}

}  // namespace

absl::StatusOr<v1::Job> Client::Train(v1::TrainSceneRequest request) const {
  request.set_scene(SceneName(request.scene()));
  if (request.request_id().empty()) request.set_request_id(NewRequestId());
  return Ask(*jobs_, &Jobs::TrainScene, request.scene(), request);
}

absl::StatusOr<v1::EstimateTrainingResponse> Client::EstimateTraining(
    const v1::EstimateTrainingRequest& request) const {
  return Ask(*jobs_, &Jobs::EstimateTraining, request.scene(), request);
}

absl::StatusOr<v1::Job> Client::GetJob(const std::string& job) const {
  v1::GetJobRequest request;
  request.set_name(JobName(job));
  return Ask(*jobs_, &Jobs::GetJob, "", request);
}

absl::StatusOr<v1::ListJobsResponse> Client::ListJobs(const std::string& scene) const {
  v1::ListJobsRequest request;
  if (!scene.empty()) request.set_scene(SceneName(scene));
  return AskAllPages(*jobs_, &Jobs::ListJobs, scene, request);
}

absl::StatusOr<v1::Job> Client::CancelJob(const std::string& job) const {
  v1::CancelJobRequest request;
  request.set_name(JobName(job));
  return Ask(*jobs_, &Jobs::CancelJob, "", request);
}

absl::StatusOr<v1::Job> Client::WatchJob(const std::string& job,
                                         absl::FunctionRef<void(const v1::JobEvent&)> on_event,
                                         const std::function<void()>& on_break) const {
  Watched watched;
  for (int failures = 0; !watched.ended;) {
    const std::optional<int64_t> before = watched.sequence;
    const absl::Status status = WatchOnce(*jobs_, JobName(job), watched, on_event);
    if (watched.ended || status.ok()) break;
    if (watched.sequence != before) failures = 0;
    if (!IsAway(status) || !watched.sequence || ++failures > kRetries) return status;
    if (on_break) on_break();
    std::this_thread::sleep_for(kRetryPause);
  }
  return GetJob(job);
}

}  // namespace pepeseg::client
