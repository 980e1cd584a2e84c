#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/model_files/checkpoint.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

// Checkpoints of one stage in a job's folder: attempt-FENCE/checkpoints/STAGE-NNNNNNNNN.ckpt, the
// newest two of each attempt. An attempt goes on from the farthest good one of those before it.
// Not thread safe.
class WorkerCheckpoints {
 public:
  using Clock = std::chrono::steady_clock;
  using Warn = std::function<void(const std::string& message)>;

  // `identity`: digest of what the state belongs to; others' checkpoints are not used. `warn`
  // hears of each file that is not used, and why, and of those that could not be written.
  WorkerCheckpoints(const JobFolder& folder, const JobSpec& spec, std::string stage,
                    std::string identity, Warn warn);

  // Begins the stage: offers the checkpoints, the farthest first, until `use` takes one. Nothing is
  // taken where there is no good one: the stage begins anew.
  void Resume(absl::FunctionRef<absl::Status(const Checkpoint& file)> use);
  // The step that the stage began at.
  int64_t first_step() const { return first_step_; }

  // Writes the state of a step as the file of a header.
  using WriteState =
      absl::FunctionRef<absl::Status(const std::filesystem::path&, const CheckpointHeader&)>;
  // After each step. Writes one after spec.checkpoint_seconds, or after spec.checkpoint_steps,
  // but by steps no oftener than costs a twentieth of the time.
  void SaveIfDue(int64_t step, WriteState write);
  void Save(int64_t step, WriteState write);

  // Those of this stage, of this attempt and those before it.
  void Remove() const;

 private:
  struct Candidate {
    std::filesystem::path path;
    int64_t step = 0;
  };

  std::vector<Candidate> Find(int64_t fence) const;  // by step, the farthest first
  std::vector<Candidate> FindAll() const;            // likewise, of all attempts so far
  std::filesystem::path Relative(const std::filesystem::path& path) const;
  std::string FileName(int64_t step) const;
  int64_t StepOf(const std::string& name) const;
  absl::StatusOr<Checkpoint> Read(const Candidate& candidate) const;
  absl::Status Write(int64_t step, WriteState write) const;

  const JobFolder& folder_;
  const JobSpec& spec_;
  const std::string stage_;
  const std::string identity_;
  const Warn warn_;
  int64_t first_step_ = 0;
  int64_t last_step_ = 0;  // of the newest checkpoint, or where the attempt began
  Clock::time_point last_save_ = Clock::now();
  Clock::duration last_cost_{};
};

// Of the files and options that stage one depends on, and those of stage two.
std::string ReconstructIdentity(const JobSpec& spec, const v1::TrainingOptions& effective);
std::string FeatureIdentity(const JobSpec& spec, const v1::TrainingOptions& effective);

}  // namespace pepeseg
