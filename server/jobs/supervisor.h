#pragma once

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <future>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/jobs/job_devices.h"
#include "server/jobs/job_feed.h"
#include "server/jobs/launcher.h"
#include "server/jobs/running_job.h"
#include "server/store/store.h"
#include "server/worker_protocol/event_log.h"
#include "server/worker_protocol/job_spec.h"

namespace pepeseg {

struct SupervisorOptions {
  std::filesystem::path data_folder;  // jobs/ID below it is the folder of a job
  std::filesystem::path worker;       // the pepeseg-worker program
  // Returns the path of a project's stored file.
  std::function<std::filesystem::path(const std::string& project, const DatasetFileRecord&)>
      file_path;
  // Reads again the stored files of a project that a worker has found damaged, sets the damaged
  // ones aside, and returns how many they are. Called on the supervisor's thread: it must not
  // block. May be empty: then nothing is set aside.
  std::function<std::shared_future<int>(const std::string& project, std::vector<DatasetFileRecord>)>
      check_files;
  WorkerOptions workers;                           // copied into each job's spec
  std::vector<JobDevice> devices = {JobDevice{}};  // each takes one job at a time; not empty
  // Maximum host memory of a worker, bytes. 0: all memory of its machine or control group.
  int64_t memory_limit = 0;
  LaunchOptions launch;
  // Called once for each new event of a job that runs here, on the supervisor's thread: it must not
  // block. May be empty.
  std::function<void(const std::string& job, const v1::JobEvent&)> on_event;
  absl::Duration cancel_grace = absl::Seconds(10);  // time from SIGTERM to SIGKILL
};

// Takes queued jobs, one for each device that is free, runs each in a worker process, and follows
// it to its end: the model is committed, or the job FAILED with the reason. A worker that crashes
// is restarted after a pause, and resumes from its checkpoints. The third crash in a row without
// progress makes the job FAIL, and so does the hundredth end of a server during it in a row without
// progress. A stop on request counts as neither. A worker's crash never ends the server; the
// server's end also ends its workers, unless they run on a cluster.
//
// When a preview waits and no device is free, one running job is stopped, saves a checkpoint and is
// queued again (RunningJob::MayBePutBack says which may be). The device that it leaves takes
// previews only, as long as one waits. The job itself is the next to be claimed.
//
// On a shared database a server holds a job by a lease, which it renews while it runs. Another
// server takes the job over when the lease has expired.
//
// Thread safe. Calls block on the store unless they say otherwise. Only the supervisor's thread
// touches running jobs and claims. Other threads leave a request under `mutex_` and wake it; what
// it has to report is in the JobFeed. It calls the store, which blocks, but never while it holds a
// mutex.
class Supervisor {
 public:
  using Watch = JobFeed::Watch;
  using Newest = JobFeed::Newest;

  // Starts the supervisor and its thread. Jobs that are RUNNING in a database of this server alone,
  // or held by a server that is known to have ended, were interrupted: it queues them again, or
  // follows them where a cluster still runs them. `store` must outlive the supervisor. NOT_FOUND:
  // options.worker is not a program.
  static absl::StatusOr<std::unique_ptr<Supervisor>> Start(Store& store, SupervisorOptions options);
  ~Supervisor();  // like Stop() with a deadline that has passed

  // Creates a job as JobStore::CreateJob does. It starts as soon as a device is free.
  absl::StatusOr<JobRecord> Submit(const JobRecord& job);
  // Cancels a queued job at once. A running job's worker is asked to stop: the record returned is
  // still RUNNING.
  absl::StatusOr<JobRecord> Cancel(const std::string& job);

  // Starts no further job, until ResumeClaiming(). Does not block.
  void StopClaiming();
  // Undoes StopClaiming(). Does not block.
  void ResumeClaiming();
  // Ends the running workers (SIGTERM; SIGKILL at `deadline`) and queues their jobs again for the
  // next start of the server. Afterwards the supervisor does nothing. May be called again, with an
  // earlier deadline, from another thread.
  void Stop(absl::Time deadline);

  // Returns a reader of a job's events after a sequence number.
  EventLogReader ReadEvents(const std::string& job, int64_t after_sequence) const;

  // Returns the newest event of a job. Reads the log if the job is not running here.
  absl::StatusOr<Newest> FindNewest(const std::string& job) const;
  // Returns the same for a job that runs here, and nothing for another. Reads no file, does not
  // block.
  std::optional<Newest> FindRunning(const std::string& job) const;

  // Returns why a job makes no progress at this server: its start or end could not be written, at
  // least twice in a row, and is tried again after a pause. OK: no obstacle is known. `queued`: the
  // job waits for its start, as far as the caller knows. Does not block.
  absl::Status FindObstacle(const std::string& job, bool queued) const;

  // Returns what runs on each of SupervisorOptions::devices. Does not block.
  std::vector<DeviceUse::Use> device_use() const { return device_use_.Get(); }

  // Calls `changed` on the supervisor's thread when a job may have new events, until the watch is
  // destroyed; at least once after the last event. `changed` must not block or call the supervisor.
  // AddWatch does not block. `changed` is not running once the watch's destructor has returned.
  std::unique_ptr<Watch> AddWatch(const std::string& job, std::function<void()> changed);

 private:
  // Interval between queries of a shared database for what other servers did.
  static constexpr absl::Duration kLookAtOthers = absl::Milliseconds(500);

  Supervisor(Store& store, SupervisorOptions options);
  JobFolder FolderOf(const std::string& job) const;
  // Queues again, or adopts, the jobs that the end of a server has interrupted. Called before the
  // thread starts.
  absl::Status Recover();
  void StartThread();
  void Wake();
  // Sets whether the thread may claim further jobs.
  void SetClaiming(bool claim);
  void Run();
  absl::Status RecoverJob(JobRecord job);
  // Parts of a claim (supervisor_claims.cc).
  bool MayClaim() const;
  std::optional<size_t> FindFreeDevice(const std::string& name = "") const;
  void Claim();
  void ClaimWhileFree();
  void StartHeld();
  void StartJob(const JobRecord& job, size_t device);
  void MakeRoomForPreview();
  RunningJob* FindVictim() const;
  void PublishDevices();
  void EndUnstarted(const JobRecord& job, const absl::Status& error);
  void PauseClaims(const std::string& job, const absl::Status& error);
  void KeepLeases();
  void LoseJobs(const std::vector<JobRecord>& held);
  void FollowJobs();
  void ApplyCancels();
  void ReportCancelled(const std::string& job);
  void FinishJobs(bool requeue);
  void Publish(const RunningJob& running);
  // Waits until there may be work. False: Stop() was called.
  bool WaitForWork();
  void EndAll();

  Store& store_;
  const SupervisorOptions options_;
  JobFeed feed_;
  DeviceUse device_use_;
  const std::unique_ptr<Launcher> launcher_;
  // Used by the thread only, and by Recover() before it starts.
  std::list<std::unique_ptr<RunningJob>> running_;
  // Whether the database may say that this server holds jobs that it does not run: the answer to a
  // claim was lost, or a start failed. No job is claimed until StartHeld() has asked.
  bool unsure_ = false;
  // Device that a job has left for a preview, and that takes previews only.
  std::optional<size_t> kept_for_preview_;
  std::string waiting_preview_;  // preview that waited at the last look; empty: none
  absl::Time next_preview_look_ = absl::InfinitePast();
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

// Returns the name under which this process holds jobs in a shared database: its machine's boot id,
// process namespace, process id and start time. No two processes that live at the same time have
// the same name, and a new process with an old process id has another name.
std::string HolderName();

// Returns whether the process with that name is known to have ended. False for a process that
// cannot be seen from here, such as one on another machine or in another container: its lease
// decides.
bool IsKnownGone(const std::string& holder);

}  // namespace pepeseg
