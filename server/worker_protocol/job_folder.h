#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/training_options.pb.h"

// What server and worker tell each other through the folder of a job. The server writes:
//   spec-FENCE.json      what to do
//   events.log           what happened before the first attempt; events-FENCE.log and
//                        events-FENCE-end.log: before and after its worker (event_log.h)
//   lease-FENCE          touched while the server holds the job (pulse.h)
//   worker.log           the worker's standard output and error, opened by who starts it
//   slurm.sh             what Slurm runs
//   attempt-FENCE/       the model of an attempt, taken out of the worker's reach
// The worker writes in work/, the only folder that its sandbox opens, and the server reads there
// only by a BeneathFolder:
//   work/events-FENCE.log    its progress
//   work/pulse-FENCE         touched by the worker
//   work/sfm.log             what COLMAP said, where it estimated poses
//   work/attempt-FENCE/      the model, once its manifest is there; reconstruct/: stage one's
//                            result; checkpoints/: its state on the way there; frames/: of videos,
//                            poses/: of the stage sfm, each whole once its own manifest is there
//   work/priors/             the priors command's files, and how it ended
//                            (worker_priors_command.h); sam/: SAM's masks of the photographs that
//                            are done (worker_sam.h)
//   work/tmp/                TMPDIR of the worker, and of the programs that it runs
//   work/result-FENCE.json   how it ended
namespace pepeseg {

struct JobSpecFile {
  std::string name;    // the client's, for matching and errors
  int kind = 0;        // pepeseg.v1.FileKind
  std::string path;    // of the bytes
  std::string sha256;  // of the bytes
};

struct JobSpec {
  std::string job;
  int64_t fence = 0;
  std::vector<JobSpecFile> files;
  v1::TrainingOptions options;  // effective ones
  std::string device;           // Device::id: opened as it is, or the attempt fails
  int num_threads = 0;
  // Stage one saves its state after so many seconds or steps, whichever come first.
  int64_t checkpoint_seconds = 60;
  int64_t checkpoint_steps = 1000;
  int64_t memory_limit = 0;  // bytes of host memory; 0: what the machine or control group has
  // W3C trace context of the call that made the job; empty: none is known. Not in every spec.json.
  std::string traceparent;
  // The worker ends when lease-FENCE was not touched for so long; 0: it has the job for itself.
  int64_t lease_seconds = 0;
};

struct JobResult {
  absl::Status status;  // of an error there is nothing else, but for `damaged`
  std::map<std::string, double> metrics;
  int64_t num_gaussians = 0;
  int64_t num_bytes = 0;  // of the model's files
  // Where "poses", "masks" and "depth" came from, as Model.sources of the contract says it.
  std::map<std::string, std::string> sources;
  // With DATA_LOSS: SHA-256 of the files whose stored bytes are damaged or gone.
  std::vector<std::string> damaged;
};

// How the worker program ends. kFailed and kCancelled come with a result, unless it could not be
// written; anything else is a crash.
enum class WorkerExit { kSucceeded = 0, kFailed = 1, kBadSpec = 2, kCancelled = 3, kLeaseLost = 4 };

// Numbers a JSON reader cannot know, as NaN, are left out of the metrics.
std::string MetricsToJson(const std::map<std::string, double>& metrics);
// Bytes that are no UTF-8 are replaced.
std::string SourcesToJson(const std::map<std::string, std::string>& sources);

// The files of a job.
class JobFolder {
 public:
  explicit JobFolder(std::filesystem::path path) : path_(std::move(path)) {}

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path events() const { return path_ / "events.log"; }
  std::filesystem::path worker_log() const { return path_ / "worker.log"; }
  std::filesystem::path lease(int64_t fence) const;
  // Where TakeModel puts the model of an attempt.
  std::filesystem::path model(int64_t fence) const;

  // The worker's.
  std::filesystem::path work() const;
  std::filesystem::path pulse(int64_t fence) const;
  std::filesystem::path sfm_log() const { return work() / "sfm.log"; }
  std::filesystem::path temporary() const { return work() / "tmp"; }
  std::filesystem::path attempt(int64_t fence) const;
  std::filesystem::path frames(int64_t fence) const;
  std::filesystem::path poses(int64_t fence) const;
  std::filesystem::path reconstruction(int64_t fence) const;
  std::filesystem::path checkpoints(int64_t fence) const;
  // What the priors command was given and made; of all attempts.
  std::filesystem::path priors() const { return work() / "priors"; }

  // Makes the folder and the worker's.
  absl::Status Make() const;
  absl::Status WriteSpec(const JobSpec& spec) const;
  absl::StatusOr<JobSpec> ReadSpec(int64_t fence) const;
  // Of the newest spec; 0: there is none.
  int64_t NewestFence() const;
  absl::Status WriteResult(int64_t fence, const JobResult& result) const;
  // Its texts are ClientTexts. NOT_FOUND: there is none. DATA_LOSS: it cannot be understood.
  absl::StatusOr<JobResult> ReadResult(int64_t fence) const;

  // Whether an attempt has left anything that a later one continues from.
  bool HasSaved(int64_t fence) const;
  // Moves the model of an attempt whose worker has ended from attempt() to model(), where no worker
  // can change what its names lead to; again is allowed. The answer: its bytes.
  // FAILED_PRECONDITION: something in it is no plain file; nothing is left of it.
  absl::StatusOr<int64_t> TakeModel(int64_t fence) const;
  // When the job has ended: everything but logs, specs, results, and the folder of that name.
  void RemoveWorkingFiles(const std::string& keep) const;

 private:
  std::filesystem::path path_;
};

// OK: the folder `model` below the data directory `data` has only regular files in it, and no part
// of its path is a link. DATA_LOSS names what is wrong.
absl::Status CheckModelFolder(const std::filesystem::path& data,
                              const std::filesystem::path& model);

}  // namespace pepeseg
