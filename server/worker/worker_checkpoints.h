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
#include "core/train/training_observer.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

// Checkpoints of one stage in a job's folder: attempt-FENCE/checkpoints/STAGE-NNNNNNNNN.ckpt, the
// newest two of each attempt. An attempt resumes from the farthest good one of all attempts so far.
// Not thread safe.
class WorkerCheckpoints final : public StageCheckpoints {
 public:
  using Clock = std::chrono::steady_clock;
  using Warn = std::function<void(const std::string& message)>;

  // `identity`: digest of what the state belongs to; checkpoints of another identity are not used.
  // Calls `warn` for each file that is not used, with the reason, and for each that could not be
  // written.
  WorkerCheckpoints(const JobFolder& folder, const JobSpec& spec, std::string stage,
                    std::string identity, Warn warn);

  void Resume(absl::FunctionRef<absl::Status(const Checkpoint& file)> use) override;
  int64_t first_step() const override { return first_step_; }
  // Due are spec.checkpoint_seconds or spec.checkpoint_steps after the last one, whichever comes
  // first; by steps only as often as keeps their cost at a twentieth of the time.
  void SaveIfDue(int64_t step, WriteState write) override;
  void Save(int64_t step, WriteState write) override;
  void Remove() const override;

 private:
  struct Candidate {
    std::filesystem::path path;
    int64_t step = 0;
  };

  std::vector<Candidate> Find(int64_t fence) const;  // by step, the farthest first
  std::vector<Candidate> FindAll() const;            // of all attempts so far, in the same order
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
  int64_t last_step_ = 0;  // of the newest checkpoint, or where the attempt started
  Clock::time_point last_save_ = Clock::now();
  Clock::duration last_cost_{};
};

// Digests of the files and options that stage one depends on, and that stage two depends on.
std::string ReconstructIdentity(const JobSpec& spec, const v1::TrainingOptions& effective);
std::string FeatureIdentity(const JobSpec& spec, const v1::TrainingOptions& effective);

}  // namespace pepeseg
