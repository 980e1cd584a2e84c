#pragma once

#include <algorithm>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "pepeseg/v1/job_service.pb.h"
#include "server/jobs/job_devices.h"
#include "server/jobs/launcher.h"
#include "server/store/store.h"
#include "server/worker_protocol/event_log.h"
#include "server/worker_protocol/heartbeat.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

struct SupervisorOptions;  // supervisor.h

// The pause between tries of an operation that keeps failing: 1 s after the first failure, doubled
// by each further one, at most 10 s. Not thread safe.
class RetryPause {
 public:
  void Fail() {
    ++num_failures_;
    last_failure_ = absl::Now();
    length_ = std::clamp(2 * length_, absl::Seconds(1), absl::Seconds(10));
  }
  void Succeed() { *this = RetryPause(); }

  // Returns the number of failures in a row.
  int num_failures() const { return num_failures_; }
  // Returns whether the next try is due. `longest` limits the pause.
  bool Over(absl::Duration longest = absl::InfiniteDuration()) const {
    return absl::Now() >= last_failure_ + std::min(length_, longest);
  }

 private:
  int num_failures_ = 0;
  absl::Duration length_ = absl::ZeroDuration();
  absl::Time last_failure_ = absl::InfinitePast();
};

// One attempt of a job: its worker, what its log has reported so far, and how it ends. Used by the
// supervisor's thread only.
class RunningJob {
 public:
  struct Dependencies {
    Store& store;
    const SupervisorOptions& options;
    Launcher& launcher;
  };
  // Writes the spec of a claimed job and launches its worker on SupervisorOptions::devices[device].
  // On an error the job is still RUNNING in the store.
  static absl::StatusOr<std::unique_ptr<RunningJob>> Start(const Dependencies& deps,
                                                           const JobRecord& job, size_t device);
  // Follows the worker that job.launch names, which another server has launched. The job takes
  // `device`, which may be SupervisorOptions::devices.size(): none of them.
  static absl::StatusOr<std::unique_ptr<RunningJob>> Adopt(const Dependencies& deps,
                                                           const JobRecord& job, size_t device);

  const JobRecord& job() const { return job_; }
  size_t device() const { return device_; }
  const std::optional<v1::JobProgress>& progress() const { return progress_; }
  int64_t sequence() const { return sequence_; }

  // Reads new events, and records a new stage in the store. Returns whether there were events.
  bool FollowLog();

  // Adopts the job's latest record after its lease was renewed, and touches the worker's lease
  // file. The record has another fence where Slurm has restarted the worker.
  void RenewLease(const JobRecord& record);
  // Kills a worker on this machine whose heartbeat has timed out: it hangs, or is suspended.
  void KillIfTimedOut();

  // Stops the worker at the first call; kills it at the first call after the shortest grace of all
  // calls has passed.
  void Terminate(absl::Duration grace);
  // Returns whether PutBack() may be called: the job is not a preview, runs on this machine, has
  // saved a checkpoint in this attempt, and the attempt has run for checkpoint_seconds, twice as
  // long after each time that the job was put back. So a job that previews interrupt again and
  // again still ends.
  bool MayBePutBack() const;
  // Stops the worker as Terminate() does. Finish() then queues the job again, and its events say
  // why.
  void PutBack(absl::Duration grace);
  bool put_back() const { return put_back_; }
  // Called when another server has taken the job over. Kills the worker if it ends with this
  // server; writes nothing.
  void Abandon();

  // Returns whether the worker has ended, and the files that it reports as damaged are checked. The
  // first call after its end starts that check.
  bool Ended();
  // Writes the outcome of a worker that has ended: first to the store, then as the log's last
  // event. A job whose worker crashed is queued again, with a pause, unless it was the third crash
  // in a row without progress, and so is one that PutBack() has stopped. `requeue`: a job that
  // Terminate() has stopped is queued again, too, instead of CANCELLED. May be called again after
  // an error. ABORTED: another server has taken the job over.
  absl::Status Finish(bool requeue);
  // Returns the pause between calls of Finish() that fail.
  RetryPause& end_pause() { return end_pause_; }

 private:
  RunningJob(const Dependencies& deps, JobRecord job, size_t device);
  absl::Duration HeartbeatTimeout() const;
  absl::Status WriteSpec() const;
  WorkerCommand Command() const;
  // Sets `outcome` to how the attempt ended; OK: there is a model. Returns an error when the server
  // cannot read or take the result now, for lack of space or descriptors.
  absl::Status ReadOutcome(JobResult* result, absl::Status* outcome);
  absl::Status TakeModel(JobResult& result) const;
  bool MayTryAgain() const;
  std::string DescribeCrash(const WorkerEnd& end) const;
  EndedAttempt DescribeAttempt() const;
  absl::Status StartCheck();
  absl::Status OutcomeOfCheck(const JobResult& result) const;
  absl::Status WriteOutcome(const absl::Status& outcome, const JobResult& result, bool requeue);
  absl::Status CommitModel(const JobResult& result);
  absl::Status WarnOfRetry(const absl::Status& outcome) const;
  void RemoveLeftovers() const;

  Dependencies deps_;
  JobRecord job_;
  const size_t device_;
  JobFolder folder_;
  EventLogReader log_;
  HeartbeatWatch heartbeat_;
  std::unique_ptr<LaunchedWorker> worker_;
  std::string stage_;
  std::optional<v1::JobProgress> progress_;
  bool follows_live_ = false;  // events already in the log at the start are not forwarded
  int64_t sequence_ = 0;
  bool terminated_ = false;
  bool put_back_ = false;
  bool crashed_ = false;     // the worker was killed, stopped from outside, or left no result
  bool timed_out_ = false;   // KillIfTimedOut() has killed the worker
  bool lease_lost_ = false;  // the worker ended because its lease was not renewed
  bool check_started_ = false;
  // Number of files that the worker reported as damaged and that are; not valid: it reported none.
  std::shared_future<int> num_damaged_;
  RetryPause end_pause_;
  absl::Time kill_at_ = absl::InfiniteFuture();
};

}  // namespace pepeseg
