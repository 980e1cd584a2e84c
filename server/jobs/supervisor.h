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
#include "server/jobs/launch_options.h"
#include "server/store/store.h"
#include "server/worker_protocol/event_log.h"

namespace pepeseg {

struct SupervisorOptions {
  std::filesystem::path data_folder;  // jobs/ID below it: everything of a job
  std::filesystem::path worker;       // the pepeseg-worker program
  // Where the bytes of a project's stored file are.
  std::function<std::filesystem::path(const std::string& project, const DatasetFileRow&)> file_path;
  // Reads stored files of a project again that a worker has found damaged, and answers how many
  // are; those are set aside. From the supervisor's thread: it must not block. May be empty: then
  // nothing is set aside.
  std::function<std::shared_future<int>(const std::string& project, std::vector<DatasetFileRow>)>
      check_files;
  std::filesystem::path lpips_weights;  // ONNX for the workers; empty: no LPIPS
  // That the workers run for masks and depth (worker_priors_command.h); empty: none.
  std::filesystem::path priors_command;
  int64_t priors_seconds = 3600;  // its time limit
  int num_slots = 1;              // jobs at a time
  std::string device = "cpu";     // of the workers, Device::id
  std::string device_name;        // Backend::name() of it, for the store
  int num_threads = 0;            // of one job; 0: as many as the machine has
  // Host memory of a worker, bytes; 0: what the worker's machine or control group has.
  int64_t memory_limit = 0;
  // A job has FAILED when its worker crashed this many times in a row without progress, or its
  // server ended during this many attempts in a row without progress. A stop that was asked for
  // counts as neither.
  int max_crashes = 3, max_server_ends = 100;
  absl::Duration silence = absl::Seconds(30);  // a worker that gives no sign for so long is killed
  std::string colmap = "colmap";               // for the workers: a path, or a name in PATH
  LaunchOptions launch;
  std::string log_format = "text";  // of the workers' lines
  // Sees each event that a job that runs here writes, once, from the supervisor's thread: it must
  // not block. May be empty.
  std::function<void(const std::string& job, const v1::JobEvent&)> on_event;
  absl::Duration cancel_grace = absl::Seconds(10);  // from SIGTERM to SIGKILL
  absl::Duration poll = absl::Milliseconds(50);     // of workers and their event logs
};

// Takes queued jobs, runs each in a worker process, and follows it to its end: the model is
// committed, or the job FAILED with the reason. A worker that crashes is started again after a
// pause, and resumes from what it has saved. A dying worker never takes the server along, and a
// dying server takes its workers along, unless they run on a cluster.
//
// On a shared database a job is held by a lease: this server prolongs it while it is well, and who
// finds it over takes the job.
//
// Thread safe. Calls block on the store unless they say otherwise.
class Supervisor {
 public:
  // Jobs found RUNNING in a database of its own, or held by a server that is known to be gone, were
  // broken off: they are queued again, or followed where a cluster still runs them. `store` must
  // outlive the supervisor.
  static absl::StatusOr<std::unique_ptr<Supervisor>> Start(Store& store, SupervisorOptions options);
  ~Supervisor();  // Stop(), with no grace left

  // As Store::CreateJob; it starts as soon as a slot is free.
  absl::StatusOr<JobRow> Submit(const JobRow& job);
  // Queued: CANCELLED at once. Running: its worker is told to stop; the answer is still RUNNING.
  absl::StatusOr<JobRow> Cancel(const std::string& job);

  // No new job is started from now on. Does not block.
  void StopClaiming();
  // Takes that back.
  void ResumeClaiming();
  // Ends the running workers (SIGTERM; SIGKILL at `deadline`) and queues their jobs again, for the
  // next start of the server. The supervisor does nothing afterwards.
  void Stop(absl::Time deadline);

  // The events of a job that come after a sequence, as they are: no snapshot, no heartbeat.
  EventLogReader ReadEvents(const std::string& job, int64_t after_sequence) const;

  // Newest event of a job and newest progress among its events; reads the log when it is not
  // running here.
  struct Newest {
    int64_t sequence = 0;
    std::optional<v1::JobProgress> progress;
  };
  absl::StatusOr<Newest> FindNewest(const std::string& job) const;
  // The same of a job that runs here, else none; reads nothing, does not block.
  std::optional<Newest> FindRunning(const std::string& job) const;

  // Why a job stands still at this server: its start or end could not be written, at least twice in
  // a row, and is tried again after a pause. OK: nothing is known to hold it up. `queued`: the job
  // waits for a slot, as far as the caller knows. Does not block.
  absl::Status FindObstacle(const std::string& job, bool queued) const;

  // While the watch lives, `changed` is called when a job may have new events, from the
  // supervisor's thread: it must not block, and not call the supervisor. At least once after the
  // last event. Neither call blocks; after the watch's destructor `changed` is not running.
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

}  // namespace pepeseg
