#include "server/worker/worker_checkpoints.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <system_error>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/digest.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// Number of checkpoints of an attempt that are kept: a damaged newest one leaves the one before.
constexpr size_t kGenerations = 2;
// Checkpoints by steps take at most 1 / kMaxCostShare of the time.
constexpr int kMaxCostShare = 20;
constexpr char kSuffix[] = ".ckpt";

// Returns the options as lines "NAME=VALUE".
template <class Options>
std::string TextOf(const Options& options) {
  std::string text;
  for (const OptionText& option : ListOptions(options)) {
    absl::StrAppend(&text, option.name, "=", option.value, "\n");
  }
  return text;
}

}  // namespace

WorkerCheckpoints::WorkerCheckpoints(const JobFolder& folder, const JobSpec& spec, Stage stage,
                                     std::string identity, Warn warn)
    : folder_(folder),
      spec_(spec),
      stage_(NameOf(stage)),
      identity_(std::move(identity)),
      warn_(std::move(warn)) {}

std::string WorkerCheckpoints::FileName(int64_t step) const {
  return absl::StrFormat("%s-%09d%s", stage_, step, kSuffix);
}

// Returns the step in a file's name; -1: it is not a checkpoint of the stage, but for example the
// temporary file of a writer that was killed.
int64_t WorkerCheckpoints::StepOf(const std::string& name) const {
  int64_t step = 0;
  const size_t first = stage_.size() + 1;
  if (!name.starts_with(stage_ + "-") || !name.ends_with(kSuffix)) return -1;
  if (!absl::SimpleAtoi(name.substr(first, name.size() - first - sizeof(kSuffix) + 1), &step)) {
    return -1;
  }
  // The number must be written exactly as FileName writes it.
  return name == FileName(step) ? step : -1;
}

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
  // The newest attempt's of equal steps comes first: the sort below is stable.
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

absl::StatusOr<Checkpoint> WorkerCheckpoints::Read(const Candidate& candidate) const {
  ASSIGN_OR_RETURN(Checkpoint file, ReadCheckpoint(candidate.path));
  if (file.header.stage != stage_) {
    return absl::FailedPreconditionError(absl::StrCat("is of stage ", file.header.stage));
  }
  if (file.header.identity != identity_) {
    return absl::FailedPreconditionError("is of other files or options");
  }
  return file;
}

void WorkerCheckpoints::Resume(absl::FunctionRef<absl::Status(const Checkpoint& file)> use) {
  for (const Candidate& candidate : FindAll()) {
    const absl::StatusOr<Checkpoint> file = Read(candidate);
    const absl::Status used = file.ok() ? use(*file) : file.status();
    if (used.ok()) {
      spdlog::info("resumes from {}", Relative(candidate.path).string());
      first_step_ = last_step_ = candidate.step;
      break;
    }
    // If the error is not the checkpoint's fault, the start from step 0 meets and returns it.
    warn_(absl::StrCat("checkpoint ", Relative(candidate.path).string(),
                       " is not used: ", used.message()));
  }
  last_save_ = Clock::now();
}

void WorkerCheckpoints::SaveIfDue(int64_t step, WriteState write) {
  const Clock::duration passed = Clock::now() - last_save_;
  const bool by_time = passed >= std::chrono::seconds(spec_.checkpoint_seconds);
  const bool by_steps =
      step - last_step_ >= spec_.checkpoint_steps && passed >= kMaxCostShare * last_cost_;
  if (by_time || by_steps) Save(step, write);
}

void WorkerCheckpoints::Save(int64_t step, WriteState write) {
  if (step == last_step_) return;
  const Clock::time_point start = Clock::now();
  const absl::Status written = Write(step, write);
  last_save_ = Clock::now();
  last_cost_ = last_save_ - start;
  // Set on an error, too: a full disk must not be tried again at every step.
  last_step_ = step;
  if (!written.ok()) {
    // The training continues without it: the next attempt resumes from an older one.
    warn_(absl::StrCat("no checkpoint of step ", step, ": ", written.message()));
    return;
  }
  const std::vector<Candidate> found = Find(spec_.fence);
  std::error_code ignored;
  // Only this attempt's: those of earlier attempts may still be read, and go with the job's end.
  for (size_t i = kGenerations; i < found.size(); ++i) {
    std::filesystem::remove(found[i].path, ignored);
  }
}

absl::Status WorkerCheckpoints::Write(int64_t step, WriteState write) const {
  const std::filesystem::path folder = folder_.checkpoints(spec_.fence);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return FileError(folder, "create", error.value());
  return write(folder / FileName(step), {stage_, identity_, step});
}

void WorkerCheckpoints::Remove() const {
  std::error_code ignored;
  for (const Candidate& candidate : FindAll()) std::filesystem::remove(candidate.path, ignored);
}

std::string ReconstructIdentity(const JobSpec& spec, const TrainingSettings& settings) {
  Sha256 digest;
  // Each field follows its length, so that different lists of fields never give the same bytes.
  const auto add = [&](const std::string& field) {
    digest.Add(absl::StrCat(field.size(), ":"));
    digest.Add(field);
  };
  add(TextOf(settings.import));
  add(TextOf(settings.reconstruct));
  for (const JobSpecFile& file : spec.files) {
    add(file.name);
    add(absl::StrCat(file.kind));
    add(file.sha256);
  }
  return digest.Hex();
}

std::string FeatureIdentity(const JobSpec& spec, const TrainingSettings& settings) {
  Sha256 digest;
  digest.Add(ReconstructIdentity(spec, settings));
  digest.Add(TextOf(settings.features));
  return digest.Hex();
}

}  // namespace pepeseg
