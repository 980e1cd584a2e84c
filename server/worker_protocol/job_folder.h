#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/worker_protocol/job_spec.h"

// The folder of a job, through which server and worker communicate. The server writes:
//   spec-FENCE.json      what the attempt has to do (job_spec.h)
//   events.log           events before the first attempt; events-FENCE.log and
//                        events-FENCE-end.log: events before and after the worker's (event_log.h)
//   lease-FENCE          touched while the server holds the job (heartbeat.h)
//   worker.log           the worker's standard output and error, opened by the launcher
//   slurm.sh             the script that Slurm runs
//   attempt-FENCE/       the model of an attempt, moved here out of the worker's reach
// The worker writes in work/, the only folder that its sandbox opens for writing. The server reads
// there only through a BeneathFolder, which follows no links:
//   work/events-FENCE.log    its progress
//   work/pulse-FENCE         touched by the worker: its heartbeat
//   work/snapshot-FENCE      the field as stage two trains it (snapshot_file.h)
//   work/sfm.log             COLMAP's output, where it estimated poses
//   work/attempt-FENCE/      the model, once its manifest is there, with embeddings of its
//                            photographs (core/priors/sam/sam_embedding.h); early/: a first
//                            model, for clicks; reconstruct/: stage one's result, or given/: the
//                            dataset's Gaussians, both as a model without features; checkpoints/:
//                            state of the stages; frames/ of videos, heic/ and poses/ of stage sfm:
//                            each whole once its own manifest is there
//   work/priors/             files of the priors command, and how it ended
//                            (core/train/priors_command.h); sam/: SAM's masks and
//                            embeddings of the photographs that are done
//                            (photograph_segmentation.h)
//   work/tmp/                TMPDIR of the worker, and of the programs that it runs
//   work/result-FENCE.json   how the attempt ended (job_spec.h)
namespace pepeseg {

// Paths and files of a job. Copyable; has no state but the path.
class JobFolder {
 public:
  explicit JobFolder(std::filesystem::path path) : path_(std::move(path)) {}

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path events() const { return path_ / "events.log"; }
  std::filesystem::path worker_log() const { return path_ / "worker.log"; }
  std::filesystem::path lease(int64_t fence) const;
  // Returns the folder into which TakeModel moves the model of an attempt.
  std::filesystem::path model(int64_t fence) const;

  // Paths below work/.
  std::filesystem::path work() const;
  std::filesystem::path heartbeat(int64_t fence) const;
  std::filesystem::path sfm_log() const { return work() / "sfm.log"; }
  std::filesystem::path temporary() const { return work() / "tmp"; }
  std::filesystem::path attempt(int64_t fence) const;
  std::filesystem::path frames(int64_t fence) const;
  std::filesystem::path poses(int64_t fence) const;
  std::filesystem::path early(int64_t fence) const;
  std::filesystem::path reconstruction(int64_t fence) const;
  std::filesystem::path given(int64_t fence) const;
  std::filesystem::path checkpoints(int64_t fence) const;
  std::filesystem::path snapshot(int64_t fence) const;
  // Returns the folder of masks and depth maps, which all attempts share.
  std::filesystem::path priors() const { return work() / "priors"; }

  // Creates the folder and work/ where they are missing.
  absl::Status Make() const;
  // WriteSpec and WriteResult replace the file atomically. ReadSpec returns DATA_LOSS if the spec
  // cannot be parsed.
  absl::Status WriteSpec(const JobSpec& spec) const;
  absl::StatusOr<JobSpec> ReadSpec(int64_t fence) const;
  // Returns the highest fence of the specs in the folder; 0: there is none.
  int64_t NewestFence() const;
  absl::Status WriteResult(int64_t fence, const JobResult& result) const;
  // Returns a result whose texts are ClientTexts. NOT_FOUND: there is none. DATA_LOSS: it cannot be
  // parsed.
  absl::StatusOr<JobResult> ReadResult(int64_t fence) const;

  // Returns whether an attempt has left anything from which a later one can resume.
  bool HasSaved(int64_t fence) const;
  // Moves the model of an attempt whose worker has ended from attempt() to model(), out of the
  // reach of workers, and returns its size in bytes. May be called again. FAILED_PRECONDITION:
  // something in it is not a plain file; the model is then removed.
  absl::StatusOr<int64_t> TakeModel(int64_t fence) const;
  // Removes everything but logs, specs, results, and the entry named `keep` (empty: none). Called
  // when the job has ended.
  void RemoveWorkingFiles(const std::string& keep) const;

 private:
  std::filesystem::path path_;
};

// Returns DATA_LOSS, naming the culprit, unless the folder `model` below the data directory `data`
// has only regular files in it and no part of its path is a link.
absl::Status CheckModelFolder(const std::filesystem::path& data,
                              const std::filesystem::path& model);

}  // namespace pepeseg
