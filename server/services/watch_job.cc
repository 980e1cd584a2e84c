#include "server/services/watch_job.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/records_to_proto.h"
#include "server/api/resource_name.h"
#include "server/rpc/stream_registry.h"
#include "server/services/job_wait.h"

namespace pepeseg {
namespace {

constexpr absl::Duration kHeartbeat = absl::Seconds(10);
constexpr absl::Duration kObstacleRetryAfter = absl::Seconds(5);

bool IsTerminal(v1::JobState state) {
  return state != v1::JOB_STATE_QUEUED && state != v1::JOB_STATE_RUNNING;
}

// Returns what a client may know about why a job is held up; the log has the details.
absl::Status HeldUpError(const std::string& job, const absl::Status& obstacle) {
  const bool full = absl::IsResourceExhausted(obstacle);
  const bool away = absl::IsUnavailable(obstacle);
  const ErrorDetail detail = {.reason = full ? kDiskFull : "JOB_HELD_UP",
                              .resource = JobName(job),
                              .retry_after = kObstacleRetryAfter};
  const char* cause = full   ? "the server's disk is full"
                      : away ? "the server cannot reach its database or open its files now"
                             : "the server cannot write to its database or its files now";
  return WithDetail(
      absl::UnavailableError(absl::StrCat(
          detail.resource, ": ", cause,
          ", so that the state of the job cannot be written; it is tried again until it can")),
      detail);
}

}  // namespace

absl::StatusOr<JobSnapshot> ReadJob(Store& store, const Supervisor& supervisor,
                                    const std::string& id) {
  // Events before the record: if the record is newer, an event only repeats what it says.
  const auto newest = supervisor.FindNewest(id);
  const auto record = store.jobs().GetJob(id);
  if (absl::IsNotFound(record.status())) {
    return WithResource(record.status(), "NO_SUCH_JOB", JobName(id));
  }
  RETURN_IF_ERROR(record.status());
  RETURN_IF_ERROR(newest.status());
  JobSnapshot snapshot{ToProto(*record), newest->sequence};
  JobWaits(store).Fill(*record, snapshot.job);
  if (newest->progress.has_value()) *snapshot.job.mutable_progress() = *newest->progress;
  return snapshot;
}

absl::Status WatchJobStream::Start() {
  ASSIGN_OR_RETURN(const AuthorizedCaller caller,
                   deps_.runner.authorizer().Authorize(origin_, request_));
  RETURN_IF_ERROR(Admit(OwnerOf(caller, origin_)));
  ASSIGN_OR_RETURN(id_, ParseJobName(request_.name(), "name"));
  // Before the snapshot, so that no event is missed in between.
  watch_ = deps_.supervisor.AddWatch(id_, [weak = weak_from_this()] {
    // Weak, since the stream owns the watch: each would keep the other alive.
    if (const auto stream = weak.lock()) stream->Wake();
  });
  ASSIGN_OR_RETURN(JobSnapshot snapshot, ReadJob(deps_.store, deps_.supervisor, id_));
  sequence_ = snapshot.sequence;
  if (request_.has_after_sequence()) {
    const int64_t after = request_.after_sequence();
    if (after < 0) return BadField("after_sequence", absl::StrCat(after), "is negative");
    if (after > snapshot.sequence) {
      // The client may have seen an event, from this or another server, that this server's
      // supervisor has not read yet.
      ASSIGN_OR_RETURN(snapshot.sequence, FindNewestInLog(snapshot.sequence));
    }
    if (after > snapshot.sequence) {
      return WithDetail(
          absl::OutOfRangeError(absl::StrCat(
              "after_sequence: ", after, ", the newest event of the job is ", snapshot.sequence)),
          {.reason = "NO_SUCH_EVENT",
           .field = "after_sequence",
           .limit = absl::StrCat(snapshot.sequence),
           .value = absl::StrCat(after)});
    }
    // The snapshot is sent with the sequence that the client knows, so that a client that
    // reconnects before the next event asks from there again.
    sequence_ = after;
  }
  reader_.emplace(deps_.supervisor.ReadEvents(id_, sequence_));
  SeeState(snapshot.job.state());
  v1::JobEvent event;
  event.set_sequence(sequence_);
  *event.mutable_time() = ToProto(absl::Now());
  *event.mutable_snapshot() = std::move(snapshot.job);
  pending_.push_back(std::move(event));
  return absl::OkStatus();
}

absl::StatusOr<int64_t> WatchJobStream::FindNewestInLog(int64_t seen) const {
  EventLogReader reader = deps_.supervisor.ReadEvents(id_, seen);
  while (true) {
    ASSIGN_OR_RETURN(const std::vector<v1::JobEvent> events, reader.Read());
    if (events.empty()) return seen;
    seen = events.back().sequence();
  }
}

absl::Status WatchJobStream::ReadMore() {
  ASSIGN_OR_RETURN(std::vector<v1::JobEvent> events, reader_->Read());
  for (v1::JobEvent& event : events) {
    // Only neighbours are merged, so that events of other kinds keep their place.
    if (event.has_progress() && !pending_.empty() && pending_.back().has_progress()) {
      pending_.pop_back();
    }
    pending_.push_back(std::move(event));
  }
  return absl::OkStatus();
}

Stream::Step WatchJobStream::Work(bool) {
  if (!reader_.has_value()) {
    if (absl::Status status = Start(); !status.ok()) return {Next::kEnd, std::move(status)};
    // New events are read only when they can replace a pending progress or nothing is pending. Thus
    // a slow reader has at most one unsent progress behind the other events.
  } else if (pending_.empty() || pending_.back().has_progress()) {
    if (absl::Status status = ReadMore(); !status.ok()) return {Next::kEnd, std::move(status)};
  }
  if (!pending_.empty()) {
    v1::JobEvent event = std::move(pending_.front());
    pending_.pop_front();
    return Send(std::move(event));
  }
  // The state that was sent last is final, and no event is pending after it.
  if (ended_) return {Next::kEnd, absl::OkStatus()};
  return SendHeartbeatWhenDue();
}

void WatchJobStream::SeeState(v1::JobState state) {
  queued_ = state == v1::JOB_STATE_QUEUED;
  ended_ = IsTerminal(state);
}

Stream::Step WatchJobStream::Send(v1::JobEvent event) {
  if (event.has_state_changed()) SeeState(event.state_changed().state());
  sequence_ = event.sequence();
  last_send_ = absl::Now();
  message_ = std::move(event);
  return {Next::kIo, absl::OkStatus()};
}

Stream::Step WatchJobStream::SendHeartbeatWhenDue() {
  const absl::Status obstacle = deps_.supervisor.FindObstacle(id_, queued_);
  if (obstacle.ok() && absl::Now() - last_send_ < kHeartbeat) {
    return {Next::kIdle, absl::OkStatus()};
  }
  // If a crash has lost the last event, or it cannot be written, the record says that the job
  // ended.
  auto snapshot = ReadJob(deps_.store, deps_.supervisor, id_);
  if (!snapshot.ok()) return {Next::kEnd, snapshot.status()};
  v1::JobEvent event;
  event.set_sequence(sequence_);
  *event.mutable_time() = ToProto(absl::Now());
  // If the log has events after `sequence_`, the end will be read from there.
  if (IsTerminal(snapshot->job.state()) && snapshot->sequence == sequence_) {
    ended_ = true;
    *event.mutable_snapshot() = std::move(snapshot->job);
  } else if (!obstacle.ok()) {
    return {Next::kEnd, HeldUpError(id_, obstacle)};
  } else {
    event.mutable_heartbeat();
  }
  return Send(std::move(event));
}

}  // namespace pepeseg
