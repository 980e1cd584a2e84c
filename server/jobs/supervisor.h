#pragma once

#include <filesystem>
#include <functional>
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
#include "server/store/store.h"
#include "server/worker_protocol/event_log.h"
#include "server/worker_protocol/job_spec.h"

namespace pepeseg {

struct SupervisorOptions {
  std::filesystem::path data_folder;  // jobs/ID below it is the folder of a job
  std::filesystem::path worker;       // the pepeseg-worker program
  // Returns the path of a project's stored file.
  std::function<std::filesystem::path(const std::string& project, const DatasetFileRow&)> file_path;
  // Reads again the stored files of a project that a worker has found damaged, sets the damaged
  // ones aside, and returns how many they are. Called on the supervisor's thread: it must not
  // block. May be empty: then nothing is set aside.
  std::function<std::shared_future<int>(const std::string& project, std::vector<DatasetFileRow>)>
      check_files;
  WorkerOptions workers;       // copied into each job's spec
  std::string device = "cpu";  // Device::id of the device that workers open
  std::string device_name;     // Backend::name() of that device, stored with each job
  int num_threads = 0;         // CPU threads of one job; 0: one per core
  // Maximum host memory of a worker, bytes. 0: all memory of its machine or control group.
  int64_t memory_limit = 0;
  LaunchOptions launch;
  // Called once for each new event of a job that runs here, on the supervisor's thread: it must not
  // block. May be empty.
  std::function<void(const std::string& job, const v1::JobEvent&)> on_event;
  absl::Duration cancel_grace = absl::Seconds(10);  // time from SIGTERM to SIGKILL
};

// Takes queued jobs, one at a time, runs each in a worker process, and follows it to its end: the
// model is committed, or the job FAILED with the reason. A worker that crashes is restarted after a
// pause, and resumes from its checkpoints. The third crash in a row without progress makes the job
// FAIL, and so does the hundredth end of a server during it in a row without progress. A stop on
// request counts as neither. A worker's crash never ends the server; the server's end also
// ends its workers, unless they run on a cluster.
//
// On a shared database a server holds a job by a lease, which it renews while it runs. Another
// server takes the job over when the lease has expired.
//
// Thread safe. Calls block on the store unless they say otherwise.
class Supervisor {
 public:
  // Starts the supervisor and its thread. Jobs that are RUNNING in a database of this server alone,
  // or held by a server that is known to have ended, were interrupted: it queues them again, or
  // follows them where a cluster still runs them. `store` must outlive the supervisor. NOT_FOUND:
  // options.worker is not a program.
  static absl::StatusOr<std::unique_ptr<Supervisor>> Start(Store& store, SupervisorOptions options);
  ~Supervisor();  // like Stop() with a deadline that has passed

  // Creates a job as JobStore::CreateJob does. It starts as soon as no other job runs here.
  absl::StatusOr<JobRow> Submit(const JobRow& job);
  // Cancels a queued job at once. A running job's worker is asked to stop: the record returned is
  // still RUNNING.
  absl::StatusOr<JobRow> Cancel(const std::string& job);

  // Starts no further job, until ResumeClaiming(). Does not block.
  void StopClaiming();
  // Undoes StopClaiming(). Does not block.
  void ResumeClaiming();
  // Ends the running workers (SIGTERM; SIGKILL at `deadline`) and queues their jobs again for the
  // next start of the server. Afterwards the supervisor does nothing.
  void Stop(absl::Time deadline);

  // Returns a reader of a job's events after a sequence number.
  EventLogReader ReadEvents(const std::string& job, int64_t after_sequence) const;

  struct Newest {
    int64_t sequence = 0;                     // number of the job's newest event; 0: there is none
    std::optional<v1::JobProgress> progress;  // the newest one among its events
  };
  // Returns the newest event of a job. Reads the log if the job is not running here.
  absl::StatusOr<Newest> FindNewest(const std::string& job) const;
  // Returns the same for a job that runs here, and nothing for another. Reads no file, does not
  // block.
  std::optional<Newest> FindRunning(const std::string& job) const;

  // Returns why a job makes no progress at this server: its start or end could not be written, at
  // least twice in a row, and is tried again after a pause. OK: no obstacle is known. `queued`: the
  // job waits for its start, as far as the caller knows. Does not block.
  absl::Status FindObstacle(const std::string& job, bool queued) const;

  // Calls `changed` on the supervisor's thread when a job may have new events, until the watch is
  // destroyed; at least once after the last event. `changed` must not block or call the supervisor.
  // AddWatch does not block. `changed` is not running once the watch's destructor has returned.
  class Watch {
   public:
    virtual ~Watch() = default;
  };
  std::unique_ptr<Watch> AddWatch(const std::string& job, std::function<void()> changed);

 private:
  class Loop;
  explicit Supervisor(std::unique_ptr<Loop> loop);
  std::unique_ptr<Loop> loop_;
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
