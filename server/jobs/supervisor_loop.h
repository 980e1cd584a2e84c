#pragma once

#include <condition_variable>
#include <list>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/jobs/job_feed.h"
#include "server/jobs/running_job.h"
#include "server/jobs/supervisor.h"
#include "server/store/store.h"

namespace pepeseg {

// The supervisor's thread, and the requests that other threads leave for it.
//
// Only that thread touches running jobs and claims. Other threads leave a request under `mutex_`
// and wake it; what it has to report is in the JobFeed. It calls the store, which blocks, but never
// while it holds a mutex. Recover() runs before the thread starts, on the caller's thread.
class Supervisor::Loop {
 public:
  Loop(Store& store, SupervisorOptions options);
  ~Loop();

  Store& store() { return store_; }
  JobFolder FolderOf(const std::string& job) const;
  JobFeed& feed() { return feed_; }

  // Queues again, or adopts, the jobs that the end of a server has interrupted. Called before
  // StartThread().
  absl::Status Recover();
  void StartThread();

  void Wake();
  // Requests the end of a job that the store has marked as cancelled.
  void RequestCancel(const std::string& job);
  // Sets whether the thread may claim further jobs.
  void SetClaiming(bool claim);
  // Ends all workers, and the thread; returns when it has ended. May be called again, with an
  // earlier deadline, from another thread.
  void StopThread(absl::Time deadline);

 private:
  // Interval between queries of a shared database for what other servers did.
  static constexpr absl::Duration kLookAtOthers = absl::Milliseconds(500);

  void Run();
  absl::Status RecoverJob(JobRow job);
  bool MayStart() const;
  void Claim();
  void StartHeld();
  void StartJob(const JobRow& job);
  void EndUnstarted(const JobRow& job, const absl::Status& error);
  void PauseClaims(const std::string& job, const absl::Status& error);
  void KeepLeases();
  void LoseJobs(const std::vector<JobRow>& held);
  void FollowJobs();
  void ApplyCancels();
  void ReportCancelled(const std::string& job);
  void FinishJobs(bool requeue);
  void Publish(const RunningJob& running);
  // Waits until there may be work. False: StopThread() was called.
  bool WaitForWork();
  void EndAll();

  Store& store_;
  const SupervisorOptions options_;
  JobFeed feed_;
  const std::unique_ptr<Launcher> launcher_;
  // Used by the thread only, and by Recover() before it starts.
  std::list<std::unique_ptr<RunningJob>> running_;
  // Whether the database may say that this server holds jobs that it does not run: the answer to a
  // claim was lost, or a start failed. No job is claimed until StartHeld() has asked.
  bool unsure_ = false;
  RetryPause claim_pause_;  // between claims or starts that fail
  RetryPause lease_log_;    // between log lines about leases that are not renewed
  absl::Time next_look_ = absl::InfinitePast();     // when to look at the leases again
  absl::Time next_renewal_ = absl::InfinitePast();  // when to renew them again
  // Latest time at which a queued job becomes claimable because its pause is over. Nothing wakes
  // the thread then.
  absl::Time pauses_end_ = absl::InfinitePast();

  mutable std::mutex mutex_;  // guards the members below, except thread_
  std::condition_variable wake_;
  bool woken_ = false;
  bool claiming_ = true;
  bool stopping_ = false;
  absl::Time stop_deadline_ = absl::InfiniteFuture();
  std::set<std::string> cancels_;  // jobs whose end is requested and not yet written

  std::thread thread_;
};

}  // namespace pepeseg
