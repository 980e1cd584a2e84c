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
#include "core/train/train.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

// The checkpoints of one stage in a job's folder: attempt-FENCE/checkpoints/STAGE-NNNNNNNNN.ckpt,
// with the step as number. Keeps the newest two of each attempt. An attempt resumes from the good
// checkpoint with the highest step of all attempts so far. Not thread safe.
class WorkerCheckpoints final : public StageCheckpoints {
 public:
  using Clock = std::chrono::steady_clock;
  using Warn = std::function<void(const std::string& message)>;

  // `identity`: digest of the files and options that the state depends on. Checkpoints with another
  // one are not used. Calls `warn` for each file that cannot be used or written, with the reason.
  WorkerCheckpoints(const JobFolder& folder, const JobSpec& spec, Stage stage, std::string identity,
                    Warn warn);

  void Resume(absl::FunctionRef<absl::Status(const Checkpoint& file)> use) override;
  int64_t first_step() const override { return first_step_; }
  // Saves if spec.checkpoint_seconds have passed since the last checkpoint, or
  // spec.checkpoint_steps steps. Steps do not count before twenty times the time that the last
  // checkpoint took, so that writing costs at most a twentieth of the run.
  void SaveIfDue(int64_t step, WriteState write) override;
  void Save(int64_t step, WriteState write) override;
  void Remove() const override;

 private:
  struct Candidate {
    std::filesystem::path path;
    int64_t step = 0;
  };

  // Return the checkpoints of one attempt, and of all attempts so far, the highest step first.
  std::vector<Candidate> Find(int64_t fence) const;
  std::vector<Candidate> FindAll() const;
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
  int64_t last_step_ = 0;  // step of the newest checkpoint, or at which the attempt started
  Clock::time_point last_save_ = Clock::now();
  Clock::duration last_cost_{};
};

// Return the digest of the files and options that stage one depends on, and that stage two does.
std::string ReconstructIdentity(const JobSpec& spec, const TrainingSettings& settings);
std::string FeatureIdentity(const JobSpec& spec, const TrainingSettings& settings);

}  // namespace pepeseg
