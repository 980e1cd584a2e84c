#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/time/time.h"
#include "pepeseg/v1/job_service.pb.h"
#include "server/rpc/service_context.h"
#include "server/rpc/stream.h"

namespace pepeseg {

// A job as GetJob answers it, with its newest progress, and the sequence of its newest event.
// Blocks on the store and the event log.
struct JobSnapshot {
  v1::Job job;
  int64_t sequence = 0;
};
absl::StatusOr<JobSnapshot> ReadJob(const ServiceContext& context, const std::string& id);

// A WatchJob call: a snapshot, then what the job's event log gets. Whatever came while a message
// was on its way to a slow reader is read at once, and only its newest progress sent. Ends with
// UNAVAILABLE when the job stands still because the server cannot write its start or end.
class WatchJobStream final : public WriteStream<v1::JobEvent> {
 public:
  WatchJobStream(const ServiceContext& context, CallOrigin origin,
                 const v1::WatchJobRequest& request)
      : WriteStream(context.streams, context.pool),
        context_(context),
        origin_(std::move(origin)),
        request_(request) {}

 private:
  Step Work(bool io_ok) override;
  void OnClosed() override { watch_.reset(); }

  absl::Status Start();
  // Returns the sequence of the newest event in the log, of which the supervisor has seen those up
  // to `seen`: a watcher of an end may ask again before the supervisor has read it.
  absl::StatusOr<int64_t> FindNewestInLog(int64_t seen) const;
  absl::Status ReadMore();
  Step Send(v1::JobEvent event);
  Step SendHeartbeatWhenDue();
  void SeeState(v1::JobState state);

  const ServiceContext context_;
  const CallOrigin origin_;
  const v1::WatchJobRequest request_;
  std::string id_;
  std::unique_ptr<Supervisor::Watch> watch_;
  std::optional<EventLogReader> reader_;
  std::deque<v1::JobEvent> pending_;
  int64_t sequence_ = 0;  // of the last event sent
  // The job, as far as the client was told.
  bool queued_ = false, ended_ = false;
  absl::Time last_send_;
};

}  // namespace pepeseg
