#include "server/jobs/worker_checkpoints.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <system_error>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/io/checkpoint.h"
#include "core/io/digest.h"
#include "core/status_macros.h"
#include "server/jobs/file_error.h"

namespace pepeseg {
namespace {

constexpr char kStage[] = "reconstruct";
constexpr size_t kGenerations = 2;
constexpr int kMaxCostShare = 20;  // by steps, a checkpoint's cost is at most 1 / this of the time
constexpr char kPrefix[] = "step-";
constexpr char kSuffix[] = ".ckpt";

std::string FileName(int64_t step) { return absl::StrFormat("%s%09d%s", kPrefix, step, kSuffix); }

// The step in a file's name; -1: it is none of ours, as what a killed writer left.
int64_t StepOf(const std::string& name) {
  int64_t step = 0;
  if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix)) return -1;
  const size_t first = sizeof(kPrefix) - 1;
  if (!absl::SimpleAtoi(name.substr(first, name.size() - first - sizeof(kSuffix) + 1), &step)) {
    return -1;
  }
  return name == FileName(step) ? step : -1;
}

}  // namespace

WorkerCheckpoints::WorkerCheckpoints(const JobFolder& folder, const JobSpec& spec,
                                     std::string identity, Warn warn)
    : folder_(folder), spec_(spec), identity_(std::move(identity)), warn_(std::move(warn)) {}

std::vector<WorkerCheckpoints::Candidate> WorkerCheckpoints::Find(int64_t fence) const {
  std::vector<Candidate> found;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder_.checkpoints(fence), error), end;
       !error && entry != end; entry.increment(error)) {
    const int64_t step = StepOf(entry->path().filename().string());
    if (step >= 0) found.push_back({entry->path(), step});
  }
  std::sort(found.begin(), found.end(),
            [](const Candidate& a, const Candidate& b) { return a.step > b.step; });
  return found;
}

std::vector<WorkerCheckpoints::Candidate> WorkerCheckpoints::FindAll() const {
  std::vector<Candidate> all;
  for (int64_t fence = spec_.fence; fence > 0; --fence) {
    const std::vector<Candidate> found = Find(fence);
    all.insert(all.end(), found.begin(), found.end());
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Candidate& a, const Candidate& b) { return a.step > b.step; });
  return all;
}

std::filesystem::path WorkerCheckpoints::Relative(const std::filesystem::path& path) const {
  return path.lexically_relative(folder_.path());
}

absl::StatusOr<ReconstructCheckpoint> WorkerCheckpoints::Read(const Candidate& candidate) const {
  ASSIGN_OR_RETURN(const Checkpoint file, ReadCheckpoint(candidate.path));
  if (file.header.stage != kStage) {
    return absl::FailedPreconditionError(absl::StrCat("is of stage ", file.header.stage));
  }
  if (file.header.identity != identity_) {
    return absl::FailedPreconditionError("is of other files or options");
  }
  return ReconstructCheckpointOf(file.sections);
}

absl::StatusOr<std::unique_ptr<Reconstructor>> WorkerCheckpoints::CreateOrResume(
    Backend& backend, const Capture& capture, const ReconstructOptions& options) {
  for (const Candidate& candidate : FindAll()) {
    absl::StatusOr<std::unique_ptr<Reconstructor>> resumed = nullptr;
    if (const auto checkpoint = Read(candidate); checkpoint.ok()) {
      resumed = Reconstructor::Resume(backend, capture, options, *checkpoint);
    } else {
      resumed = checkpoint.status();
    }
    if (resumed.ok()) {
      spdlog::info("goes on from {}", Relative(candidate.path).string());
      first_step_ = last_step_ = candidate.step;
      last_save_ = Clock::now();
      return resumed;
    }
    // An error that a fresh start meets as well is told by it.
    warn_(absl::StrCat("checkpoint ", Relative(candidate.path).string(),
                       " is not used: ", resumed.status().message()));
  }
  last_save_ = Clock::now();
  return Reconstructor::Create(backend, capture, options);
}

void WorkerCheckpoints::SaveIfDue(Reconstructor& reconstructor, int64_t step) {
  const Clock::duration passed = Clock::now() - last_save_;
  const bool by_time = passed >= std::chrono::seconds(spec_.checkpoint_seconds);
  const bool by_steps =
      step - last_step_ >= spec_.checkpoint_steps && passed >= kMaxCostShare * last_cost_;
  if (by_time || by_steps) Save(reconstructor, step);
}

void WorkerCheckpoints::Save(Reconstructor& reconstructor, int64_t step) {
  if (step == last_step_) return;
  const Clock::time_point start = Clock::now();
  const absl::Status written = Write(reconstructor, step);
  last_save_ = Clock::now();
  last_cost_ = last_save_ - start;
  last_step_ = step;
  if (!written.ok()) {
    // Training goes on without it: the next attempt starts from an older one.
    warn_(absl::StrCat("no checkpoint of step ", step, ": ", written.message()));
    return;
  }
  const std::vector<Candidate> found = Find(spec_.fence);
  std::error_code ignored;
  for (size_t i = kGenerations; i < found.size(); ++i) {
    std::filesystem::remove(found[i].path, ignored);
  }
}

absl::Status WorkerCheckpoints::Write(Reconstructor& reconstructor, int64_t step) const {
  const std::filesystem::path folder = folder_.checkpoints(spec_.fence);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return FileError(folder, "create", error.value());
  ASSIGN_OR_RETURN(const ReconstructCheckpoint checkpoint, reconstructor.Save());
  RETURN_IF_ERROR(Validate(checkpoint));
  return WriteCheckpoint(folder / FileName(step), {kStage, identity_, step},
                         SectionsOf(checkpoint));
}

void WorkerCheckpoints::RemoveAll() const {
  std::error_code ignored;
  for (int64_t fence = spec_.fence; fence > 0; --fence) {
    std::filesystem::remove_all(folder_.checkpoints(fence), ignored);
  }
}

std::string ReconstructIdentity(const JobSpec& spec, const v1::TrainingOptions& effective) {
  Sha256 digest;
  // Lengths first, so that no two lists of fields run together to the same bytes.
  const auto add = [&](const std::string& field) {
    digest.Add(absl::StrCat(field.size(), ":"));
    digest.Add(field);
  };
  add(effective.import().SerializeAsString());
  add(effective.reconstruct().SerializeAsString());
  for (const JobSpecFile& file : spec.files) {
    add(file.name);
    add(absl::StrCat(file.kind));
    add(file.sha256);
  }
  return digest.Hex();
}

}  // namespace pepeseg
