#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/reconstruct/reconstructor.h"
#include "server/jobs/job_folder.h"

namespace pepeseg {

// Checkpoints of stage one in a job's folder: attempt-FENCE/checkpoints/step-NNNNNNNNN.ckpt, the
// newest two of each attempt. An attempt goes on from the farthest good one of those before it.
// Not thread safe.
class WorkerCheckpoints {
 public:
  using Clock = std::chrono::steady_clock;
  using Warn = std::function<void(const std::string& message)>;

  // `identity`: digest of what the state belongs to; others' checkpoints are not used. `warn`
  // hears of each file that is not used, and why, and of those that could not be written.
  WorkerCheckpoints(const JobFolder& folder, const JobSpec& spec, std::string identity, Warn warn);

  // What Reconstructor::Create answers when there is no good checkpoint.
  absl::StatusOr<std::unique_ptr<Reconstructor>> CreateOrResume(Backend& backend,
                                                                const Capture& capture,
                                                                const ReconstructOptions& options);
  // The step that the reconstructor began at.
  int64_t first_step() const { return first_step_; }

  // After each step. Writes one after spec.checkpoint_seconds, or after spec.checkpoint_steps,
  // but by steps no oftener than costs a twentieth of the time.
  void SaveIfDue(Reconstructor& reconstructor, int64_t step);
  void Save(Reconstructor& reconstructor, int64_t step);

  // Of this attempt and those before it.
  void RemoveAll() const;

 private:
  struct Candidate {
    std::filesystem::path path;
    int64_t step = 0;
  };

  std::vector<Candidate> Find(int64_t fence) const;  // by step, the farthest first
  std::vector<Candidate> FindAll() const;            // likewise, of all attempts so far
  std::filesystem::path Relative(const std::filesystem::path& path) const;
  absl::StatusOr<ReconstructCheckpoint> Read(const Candidate& candidate) const;
  absl::Status Write(Reconstructor& reconstructor, int64_t step) const;

  const JobFolder& folder_;
  const JobSpec& spec_;
  const std::string identity_;
  const Warn warn_;
  int64_t first_step_ = 0;
  int64_t last_step_ = 0;  // of the newest checkpoint, or where the attempt began
  Clock::time_point last_save_ = Clock::now();
  Clock::duration last_cost_{};
};

// Of the files and options that stage one depends on.
std::string ReconstructIdentity(const JobSpec& spec, const v1::TrainingOptions& effective);

}  // namespace pepeseg
