#pragma once

#include <condition_variable>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "server/jobs/retry_pause.h"
#include "server/jobs/running_job.h"
#include "server/jobs/supervisor.h"
#include "server/jobs/watch_list.h"
#include "server/store/store.h"

namespace pepeseg {

// The supervisor's thread and what it shares with its callers. Only that thread touches running
// jobs: other threads leave a request under the mutex and wake it.
class Supervisor::Loop {
 public:
  Loop(Store& store, SupervisorOptions options);
  ~Loop();

  Store& store() { return store_; }
  JobFolder FolderOf(const std::string& job) const;
  WatchList& watches() { return watches_; }

  // Queues again, or adopts, the jobs that the end of a server has interrupted.
  absl::Status Recover();
  void StartThread();

  void Wake();
  // Requests the end of a job that the store has marked as cancelled.
  void WishCancel(const std::string& job);
  void WishClaims(bool claim);
  void StopThread(absl::Time deadline);
  // The newest event and progress of a job that runs here.
  std::optional<Newest> FindRunning(const std::string& job) const;
  absl::Status FindObstacle(const std::string& job, bool queued) const;

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
  void TellCancelled(const std::string& job);
  void FinishJobs(bool requeue);
  void Publish(const RunningJob& running);
  // Records that `error` has stopped the start or end of `job`; empty: of every queued job.
  void SetObstacle(const std::string& job, const absl::Status& error);
  void ClearObstacle(const std::string& job);
  void KeepObstaclesOf(const std::vector<JobRow>& held);
  // Removes the state of a job that no longer runs here.
  void Forget(const std::string& job);
  bool WaitForWork();  // false: time to stop
  void EndAll();

  Store& store_;
  const SupervisorOptions options_;
  WatchList watches_;
  const std::unique_ptr<Launcher> launcher_;
  // Used by the thread only.
  std::list<std::unique_ptr<RunningJob>> running_;
  bool unsure_ = false;     // this server may hold jobs that it does not run
  RetryPause claim_pause_;  // of claims and starts
  RetryPause lease_log_;    // between the lines about leases that are not renewed
  absl::Time next_look_ = absl::InfinitePast(), next_renewal_ = absl::InfinitePast();
  // Until then a queued job may become claimable without anything waking this thread.
  absl::Time pauses_end_ = absl::InfinitePast();

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable wake_;
  bool woken_ = false;
  bool claiming_ = true;
  bool stopping_ = false;
  absl::Time stop_deadline_ = absl::InfiniteFuture();
  std::set<std::string> cancels_;
  std::map<std::string, Newest> newest_;
  std::map<std::string, absl::Status> obstacles_;  // by job; empty: of the queue

  std::thread thread_;
};

}  // namespace pepeseg
