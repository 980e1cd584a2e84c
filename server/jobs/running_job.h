#pragma once

#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "pepeseg/v1/job_service.pb.h"
#include "server/jobs/launcher.h"
#include "server/jobs/retry_pause.h"
#include "server/jobs/supervisor.h"
#include "server/store/store.h"
#include "server/worker_protocol/event_log.h"
#include "server/worker_protocol/job_folder.h"
#include "server/worker_protocol/pulse.h"

namespace pepeseg {

// One attempt of a job: its worker, what its log has reported so far, and how it ends. Belongs to
// the supervisor's thread.
class RunningJob {
 public:
  struct Context {
    Store& store;
    const SupervisorOptions& options;
    Launcher& launcher;
  };
  // Writes the spec and launches the worker. On an error the job is still RUNNING in the store.
  static absl::StatusOr<std::unique_ptr<RunningJob>> Start(const Context& context,
                                                           const JobRow& job);
  // Follows the worker that job.launch names, which another server has launched.
  static absl::StatusOr<std::unique_ptr<RunningJob>> Adopt(const Context& context,
                                                           const JobRow& job);

  const JobRow& job() const { return job_; }
  const std::optional<v1::JobProgress>& progress() const { return progress_; }
  int64_t sequence() const { return sequence_; }

  // Reads new events, and records a new stage in the store. True: there were events.
  bool FollowLog();

  // Called with the store's record of a job that this server holds: renews the worker's lease file.
  // A worker that its launcher has restarted has taken another fence.
  void Held(const JobRow& row);
  // Kills a worker whose heartbeat has timed out: it hangs, or is suspended.
  void KillIfSilent();

  // Stops the worker at the first call; kills it at the first call after the shortest grace of all
  // calls has passed.
  void Terminate(absl::Duration grace);
  // Called when another server has taken the job over. Kills the worker if it ends with this
  // server; writes nothing.
  void Abandon();

  // Whether the worker has ended, and the damaged files that it reports have been checked.
  bool Ended();
  // Writes the outcome of a worker that has ended: first the store, then the log's last event.
  // `requeue`: a worker that Terminate() has ended puts its job back into the queue. So does a
  // crash, after a pause, unless it is the max_crashes-th in a row without progress. After an error
  // it can be called again.
  absl::Status Finish(bool requeue);
  // The pause between calls of Finish() that fail.
  RetryPause& end_pause() { return end_pause_; }

 private:
  RunningJob(const Context& context, JobRow job, JobFolder folder);
  absl::Status WriteSpec() const;
  WorkerCommand Command() const;
  // Sets `outcome` to how the attempt ended; OK: there is a model. Returns an error when the server
  // cannot read or take the result now, for lack of space or descriptors.
  absl::Status ReadOutcome(JobResult* result, absl::Status* outcome);
  absl::Status TakeModel(JobResult& result) const;
  bool MayTryAgain() const;
  std::string DescribeCrash(const WorkerEnd& end) const;
  EndedAttempt DescribeAttempt() const;
  absl::Status AskForCheck();
  absl::Status OutcomeOfCheck(const JobResult& result) const;
  absl::Status WriteOutcome(const absl::Status& outcome, const JobResult& result, bool requeue);
  absl::Status CommitModel(const JobResult& result);
  void RemoveLeftovers() const;

  Context context_;
  JobRow job_;
  JobFolder folder_;
  EventLogReader log_;
  PulseWatch pulse_;
  std::unique_ptr<LaunchedWorker> worker_;
  std::string stage_;
  std::optional<v1::JobProgress> progress_;
  bool follows_live_ = false;  // events already in the log at the start are not forwarded
  int64_t sequence_ = 0;
  bool terminated_ = false;
  bool crashed_ = false;  // it was killed, or ended without a result
  bool silent_ = false;
  bool lease_lost_ = false;
  bool asked_for_check_ = false;
  std::shared_future<int> num_damaged_;  // of the files that the worker has found damaged
  RetryPause end_pause_;
  absl::Time kill_at_ = absl::InfiniteFuture();
};

}  // namespace pepeseg
