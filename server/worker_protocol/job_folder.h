#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/training_options.pb.h"
#include "server/worker_protocol/worker_options.h"

// The folder of a job, through which server and worker communicate. The server writes:
//   spec-FENCE.json      what to do
//   events.log           events before the first attempt; events-FENCE.log and
//                        events-FENCE-end.log: before and after the worker's (event_log.h)
//   lease-FENCE          touched while the server holds the job (heartbeat.h)
//   worker.log           the worker's standard output and error, opened by the launcher
//   slurm.sh             the script that Slurm runs
//   attempt-FENCE/       the model of an attempt, moved out of the worker's reach
// The worker writes in work/, the only folder that its sandbox opens for writing. The server reads
// there only through a BeneathFolder:
//   work/events-FENCE.log    its progress
//   work/pulse-FENCE         the heartbeat: touched by the worker
//   work/sfm.log             COLMAP's output, where it estimated poses
//   work/attempt-FENCE/      the model, once its manifest is there; reconstruct/: stage one's
//                            result; checkpoints/: state of the stages; frames/ of videos, heic/
//                            and poses/ of stage sfm: each whole once its own manifest is there
//   work/priors/             files of the priors command, and how it ended
//                            (core/train/priors_command.h); sam/: SAM's masks of the
//                            photographs that are done (photograph_segmentation.h)
//   work/tmp/                TMPDIR of the worker, and of the programs that it runs
//   work/result-FENCE.json   how it ended
namespace pepeseg {

struct JobSpecFile {
  std::string name;    // the client's, for matching and errors
  int kind = 0;        // pepeseg.v1.FileKind
  std::string path;    // of the bytes
  std::string sha256;  // of the bytes
};

// What one attempt of a job is to do. The worker's command line only names the folder, the fence
// and the process that started it; everything else is here.
struct JobSpec {
  std::string job;
  int64_t fence = 0;
  std::vector<JobSpecFile> files;
  v1::TrainingOptions options;  // in effect: every field is present
  std::string device;           // Device::id; the attempt fails when it cannot be opened
  int num_threads = 0;
  // A stage saves its state after this many seconds or steps, whichever come first.
  int64_t checkpoint_seconds = 60;
  int64_t checkpoint_steps = 1000;
  int64_t memory_limit = 0;  // bytes of host memory; 0: what the machine or control group has
  // W3C trace context of the call that made the job; empty: unknown. Not in every spec.json.
  std::string traceparent;
  // The worker ends when lease-FENCE was not touched for this long; 0: nobody else can claim the
  // job.
  int64_t lease_seconds = 0;
  WorkerOptions worker;
};

struct JobResult {
  absl::Status status;  // with an error only `damaged` is set
  std::map<std::string, double> metrics;
  int64_t num_gaussians = 0;
  int64_t num_bytes = 0;  // of the model's files
  // Where "poses", "masks" and "depth" came from, see Model.sources in the contract.
  std::map<std::string, std::string> sources;
  // With DATA_LOSS: SHA-256 of the files whose stored bytes are damaged or gone.
  std::vector<std::string> damaged;
};

// Exit codes of the worker. kFailed and kCancelled come with a result, unless it could not be
// written. Any other code is a crash.
enum class WorkerExit { kSucceeded = 0, kFailed = 1, kBadSpec = 2, kCancelled = 3, kLeaseLost = 4 };

// The metrics as a JSON object, without those that are not finite.
std::string MetricsToJson(const std::map<std::string, double>& metrics);
// The sources as a JSON object; bytes that are not UTF-8 are replaced.
std::string SourcesToJson(const std::map<std::string, std::string>& sources);

// Paths and files of a job.
class JobFolder {
 public:
  explicit JobFolder(std::filesystem::path path) : path_(std::move(path)) {}

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path events() const { return path_ / "events.log"; }
  std::filesystem::path worker_log() const { return path_ / "worker.log"; }
  std::filesystem::path lease(int64_t fence) const;
  // The folder into which TakeModel moves the model of an attempt.
  std::filesystem::path model(int64_t fence) const;

  // Below work/.
  std::filesystem::path work() const;
  std::filesystem::path heartbeat(int64_t fence) const;
  std::filesystem::path sfm_log() const { return work() / "sfm.log"; }
  std::filesystem::path temporary() const { return work() / "tmp"; }
  std::filesystem::path attempt(int64_t fence) const;
  std::filesystem::path frames(int64_t fence) const;
  std::filesystem::path poses(int64_t fence) const;
  std::filesystem::path reconstruction(int64_t fence) const;
  std::filesystem::path checkpoints(int64_t fence) const;
  // Shared by all attempts.
  std::filesystem::path priors() const { return work() / "priors"; }

  // Makes the folder and work/.
  absl::Status Make() const;
  absl::Status WriteSpec(const JobSpec& spec) const;
  absl::StatusOr<JobSpec> ReadSpec(int64_t fence) const;
  // Fence of the newest spec; 0: there is none.
  int64_t NewestFence() const;
  absl::Status WriteResult(int64_t fence, const JobResult& result) const;
  // Returns a result whose texts are ClientTexts. NOT_FOUND: there is none. DATA_LOSS: it cannot be
  // parsed.
  absl::StatusOr<JobResult> ReadResult(int64_t fence) const;

  // Whether an attempt has left anything that a later one can resume from.
  bool HasSaved(int64_t fence) const;
  // Moves the model of an attempt whose worker has ended from attempt() to model(), out of the
  // reach of workers, and returns its size in bytes. May be called again. FAILED_PRECONDITION:
  // something in it is not a plain file; the model is then removed.
  absl::StatusOr<int64_t> TakeModel(int64_t fence) const;
  // Called when the job has ended. Removes everything but logs, specs, results, and the folder of
  // that name.
  void RemoveWorkingFiles(const std::string& keep) const;

 private:
  std::filesystem::path path_;
};

// Returns DATA_LOSS, naming the culprit, unless the folder `model` below the data directory `data`
// has only regular files in it and no part of its path is a link.
absl::Status CheckModelFolder(const std::filesystem::path& data,
                              const std::filesystem::path& model);

}  // namespace pepeseg
