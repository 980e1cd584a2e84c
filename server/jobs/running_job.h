#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "pepeseg/v1/job_service.pb.h"
#include "server/jobs/event_log.h"
#include "server/jobs/job_folder.h"
#include "server/jobs/process.h"
#include "server/jobs/store.h"
#include "server/jobs/supervisor.h"

namespace pepeseg {

// One attempt of a job: its worker process, what its log has told so far, and how it ends. Belongs
// to the supervisor's thread.
class RunningJob {
 public:
  struct Context {
    Store& store;
    const SupervisorOptions& options;
  };
  // Writes the spec and launches the worker. On an error the job is still RUNNING in the store.
  static absl::StatusOr<std::unique_ptr<RunningJob>> Start(const Context& context,
                                                           const JobRow& job);

  const JobRow& job() const { return job_; }
  const std::optional<v1::JobProgress>& progress() const { return progress_; }
  int64_t sequence() const { return sequence_; }

  // Reads what the log has gained and notes a new stage in the store. True when there was anything.
  bool FollowLog();

  // SIGTERM at the first call; SIGKILL at the first one after the shortest grace asked for is over.
  void Terminate(absl::Duration grace);

  // Whether the worker has ended.
  bool Ended() { return process_->Poll().has_value(); }
  // Writes the outcome of a worker that has ended: first the store, then the log's last event.
  // `requeue`: an end that was asked for by Terminate() puts the job back into the queue.
  absl::Status Finish(bool requeue);

 private:
  RunningJob(const Context& context, JobRow job, JobFolder folder);
  absl::Status WriteSpec() const;
  absl::Status Outcome(JobResult* result);  // OK: there is a model
  std::string DescribeCrash(const WorkerProcess::End& end) const;
  absl::Status CommitModel(const JobResult& result);

  Context context_;
  JobRow job_;
  JobFolder folder_;
  EventLogReader log_;
  std::unique_ptr<WorkerProcess> process_;
  std::string stage_;
  std::optional<v1::JobProgress> progress_;
  int64_t sequence_ = 0;
  bool terminated_ = false;
  absl::Time kill_at_ = absl::InfiniteFuture();
};

// Appends the event that tells of a job's new state. The job must have no worker.
absl::Status AppendState(const JobFolder& folder, const JobRow& job);

}  // namespace pepeseg
