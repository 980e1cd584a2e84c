#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "pepeseg/v1/job_service.pb.h"
#include "server/jobs/supervisor.h"
#include "server/rpc/call_runner.h"
#include "server/rpc/stream.h"
#include "server/store/store.h"

namespace pepeseg {

struct JobSnapshot {
  v1::Job job;           // with its newest progress
  int64_t sequence = 0;  // of its newest event
};
// Reads a job as GetJob answers it. Blocks on the store and the event log. NOT_FOUND.
absl::StatusOr<JobSnapshot> ReadJob(Store& store, const Supervisor& supervisor,
                                    const std::string& id);

// A WatchJob call: sends a snapshot, then the events of the job's log as they come. Events that
// came while a slow reader took a message are read together, and only the newest progress of them
// is sent. Ends with UNAVAILABLE if the job is held up because the server cannot write its start or
// end.
class WatchJobStream final : public WriteStream<v1::JobEvent> {
 public:
  // All must outlive the stream.
  struct Dependencies {
    const CallRunner& runner;
    Store& store;
    Supervisor& supervisor;
  };
  WatchJobStream(const Dependencies& deps, CallOrigin origin, const v1::WatchJobRequest& request)
      : WriteStream(&deps.runner.streams(), &deps.runner.pools().io),
        deps_(deps),
        origin_(std::move(origin)),
        request_(request) {}

 private:
  Step Work(bool io_ok) override;
  void OnClosed() override { watch_.reset(); }

  // Authorises the call and prepares the snapshot.
  absl::Status Start();
  // Returns the sequence of the newest event in the log. `seen`: the newest event that the
  // supervisor has read, which can be older: a client that has seen the last event may call again
  // at once.
  absl::StatusOr<int64_t> FindNewestInLog(int64_t seen) const;
  // Reads the events that are new in the log into `pending_`.
  absl::Status ReadMore();
  Step Send(v1::JobEvent event);
  Step SendHeartbeatWhenDue();
  void SeeState(v1::JobState state);

  const Dependencies deps_;
  const CallOrigin origin_;
  const v1::WatchJobRequest request_;
  std::string id_;
  std::unique_ptr<Supervisor::Watch> watch_;
  std::optional<EventLogReader> reader_;
  std::deque<v1::JobEvent> pending_;
  int64_t sequence_ = 0;  // of the last event sent
  // State of the job as last sent to the client.
  bool queued_ = false, ended_ = false;
  absl::Time last_send_;
};

}  // namespace pepeseg
