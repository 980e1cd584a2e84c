#include "server/services/job_snapshots.h"

#include <spdlog/spdlog.h>
#include <stdlib.h>

#include <cerrno>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "core/model_files/model_file.h"
#include "server/api/error.h"
#include "server/store/layout.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr absl::Duration kRetryAfter = absl::Seconds(1);

// Returns UNAVAILABLE with what the job still has to do before it can be queried.
absl::Status NoSnapshotError(const JobRecord& job) {
  std::string why = absl::StrCat("is in stage ", job.stage.empty() ? "prepare" : job.stage);
  if (job.state == JobState::kQueued) why = "waits for its start";
  if (job.stage == "index") why = "is writing its model";
  return WithDetail(
      absl::UnavailableError(absl::StrCat(
          JobName(job.id), " ", why,
          ": it answers from about a second after the first step of stage features on; a GPU with "
          "room for it answers earlier, in stage reconstruct")),
      {.reason = "NO_SNAPSHOT", .resource = JobName(job.id), .retry_after = kRetryAfter});
}

// Returns whether the reason of an error is what the worker has written.
bool IsWorkersFault(const absl::Status& status) {
  return absl::IsDataLoss(status) || absl::IsInvalidArgument(status) || absl::IsNotFound(status) ||
         absl::IsFailedPrecondition(status);
}

// Returns whether models leave no room for another one. A private error is of files or the
// database.
bool LacksRoom(const absl::Status& status) {
  return !IsPrivate(status) && (absl::IsResourceExhausted(status) || absl::IsUnavailable(status));
}

// A copy of the Gaussians of an attempt's snapshots, out of the worker's reach. It goes with the
// object.
class CopiedGaussians {
 public:
  explicit CopiedGaussians(fs::path scratch) : scratch_(std::move(scratch)) {}
  ~CopiedGaussians() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  CopiedGaussians(const CopiedGaussians&) = delete;
  CopiedGaussians& operator=(const CopiedGaussians&) = delete;

  absl::Status Copy(const JobFolder& folder, const SnapshotStamp& stamp, int64_t max_bytes) {
    std::error_code error;
    fs::create_directories(scratch_, error);
    std::string path = scratch_ / "snapshot-XXXXXX";
    if (mkdtemp(path.data()) == nullptr) return FileError(path, "make", errno);
    path_ = path;
    return CopySnapshotGaussians(folder, stamp, path_, max_bytes);
  }
  const fs::path& path() const { return path_; }

 private:
  const fs::path scratch_;
  fs::path path_;
};

// Returns a copy of a model with another field. DATA_LOSS: the field is of other Gaussians.
absl::StatusOr<Model> WithFeatures(Model model, FeatureField field) {
  if (field.features.size() != static_cast<size_t>(model.gaussians.count) * kFeatureDim) {
    return absl::DataLossError(absl::StrCat("the snapshot has ",
                                            field.features.size() / kFeatureDim, " features for ",
                                            model.gaussians.count, " Gaussians"));
  }
  model.field = std::move(field);
  return model;
}

bool HaveSameGaussians(const SnapshotStamp& a, const SnapshotStamp& b) {
  return a.fence == b.fence && a.is_early == b.is_early;
}

// Reads an early model, and describes it.
absl::StatusOr<Model> ReadEarlyModel(const fs::path& folder, v1::Snapshot& snapshot) {
  ASSIGN_OR_RETURN(Model model, ReadModel(folder));
  if (model.field.empty()) return absl::DataLossError("the early model has no features");
  snapshot.set_stage(v1::JOB_STAGE_RECONSTRUCT);
  snapshot.set_step(static_cast<int64_t>(model.metrics[kEarlyStep]));
  snapshot.set_num_steps(static_cast<int64_t>(model.metrics[kEarlyNumSteps]));
  return model;
}

ModelShape ShapeOf(const Model& model) {
  return {model.gaussians.count, model.gaussians.sh_degree, LargestView(model.views)};
}

// Returns a copy of a model without its field.
Model WithoutField(const Model& model) {
  Model copy;
  copy.gaussians = model.gaussians;
  copy.views = model.views;
  copy.origin = model.origin;
  copy.scene_radius = model.scene_radius;
  copy.metrics = model.metrics;
  copy.facts = model.facts;
  return copy;
}

}  // namespace

absl::StatusOr<ResidentModel> JobSnapshots::Load(const NamedScenes& scenes, const std::string& name,
                                                 const std::string& field) {
  if (!absl::StartsWith(name, "jobs/")) return models_.Load(scenes, name, field);
  ASSIGN_OR_RETURN(const std::string id, ParseJobName(name, field));
  const absl::StatusOr<JobRecord> job = models_.store().jobs().GetJob(id);
  if (absl::IsNotFound(job.status())) return WithResource(job.status(), "NO_SUCH_JOB", name);
  RETURN_IF_ERROR(job.status());
  if (!IsTerminal(job->state)) return LoadNewest(*job);
  Forget(id);
  return LoadModelOf(*job);
}

absl::StatusOr<ResidentModel> JobSnapshots::LoadWithFeatures(const NamedScenes& scenes,
                                                             const std::string& name,
                                                             const std::string& field) {
  ASSIGN_OR_RETURN(ResidentModel model, Load(scenes, name, field));
  RETURN_IF_ERROR(CheckFeatures(model));
  return model;
}

absl::StatusOr<ResidentModel> JobSnapshots::LoadModelOf(const JobRecord& job) {
  // Number 0 would mean the scene's live model.
  if (job.model != 0) return models_.Load(SceneChild{job.scene, job.model});
  const char* const how = job.state == JobState::kCancelled ? "was cancelled" : "has failed";
  return WithResource(
      absl::FailedPreconditionError(absl::StrCat(JobName(job.id), " ", how, ": it has no model")),
      "NO_MODEL", JobName(job.id));
}

absl::StatusOr<ResidentModel> JobSnapshots::LoadNewest(const JobRecord& job) {
  const std::shared_ptr<Entry> entry = EntryOf(job.id);
  std::unique_lock loading(entry->loading, std::try_to_lock);
  if (!loading) {
    if (auto older = FindResident(job, *entry)) return *std::move(older);
    loading.lock();
  }
  const std::optional<SnapshotStamp> newest = FindSnapshot(FolderOf(job.id), job.fence);
  std::optional<ResidentModel> older = FindResident(job, *entry);
  // Only the holder of `loading` changes these two.
  const bool is_new = newest && newest != entry->unusable && (!older || newest != entry->stamp);
  if (!is_new) {
    if (older) return *std::move(older);
    return NoSnapshotError(job);
  }
  auto loaded = LoadFile(job, *newest, older ? &*older : nullptr, *entry);
  if (older && LacksRoom(loaded.status())) {
    // Memory has room for one only, so the older one is freed first.
    older.reset();
    models_.devices().Drop(entry->key);
    loaded = LoadFile(job, *newest, nullptr, *entry);
  }
  if (loaded.ok()) return loaded;
  spdlog::warn("{}: a snapshot is not used: {}", JobName(job.id), loaded.status().ToString());
  if (IsWorkersFault(loaded.status())) {
    const std::lock_guard lock(mutex_);
    entry->unusable = newest;
  }
  if (older) return *std::move(older);
  return IsWorkersFault(loaded.status()) ? NoSnapshotError(job) : loaded.status();
}

// Takes the Gaussians of an older snapshot of the same attempt, which are the same, or copies them.
absl::StatusOr<ResidentModel> JobSnapshots::LoadFile(const JobRecord& job,
                                                     const SnapshotStamp& stamp,
                                                     const ResidentModel* older, Entry& entry) {
  const JobFolder folder = FolderOf(job.id);
  if (older != nullptr && !HaveSameGaussians(*entry.stamp, stamp)) older = nullptr;
  CopiedGaussians copied(scratch_);
  v1::Snapshot snapshot = entry.stamp == stamp ? entry.snapshot : v1::Snapshot();
  snapshot.set_job(JobName(job.id));
  LoadableModel loadable;
  loadable.name = snapshot.job();
  loadable.key = absl::StrCat(loadable.name, "/", stamp.fence, "/",
                              absl::ToUnixNanos(stamp.modified), "/", stamp.num_bytes);
  loadable.project = job.scene.project;
  loadable.shape = [&]() -> absl::StatusOr<ModelShape> {
    if (older != nullptr) return ShapeOf((*older)->model());
    // Already there if another device had no room.
    if (copied.path().empty()) RETURN_IF_ERROR(copied.Copy(folder, stamp, MaxBytes()));
    return ReadModelShape(copied.path());
  };
  loadable.read = [&]() -> absl::StatusOr<Model> {
    if (stamp.is_early) return ReadEarlyModel(copied.path(), snapshot);
    snapshot.set_stage(v1::JOB_STAGE_FEATURES);
    ASSIGN_OR_RETURN(SnapshotFile read, ReadSnapshotFile(folder, job.id, stamp.fence, MaxBytes()));
    snapshot.set_step(read.step);
    snapshot.set_num_steps(read.num_steps);
    if (older != nullptr)
      return WithFeatures(WithoutField((*older)->model()), std::move(read.field));
    ASSIGN_OR_RETURN(Model model, ReadModel(copied.path()));
    return WithFeatures(std::move(model), std::move(read.field));
  };
  ASSIGN_OR_RETURN(ModelCache::Handle loaded, models_.Load(loadable));
  std::string replaced = loadable.key;
  {
    const std::lock_guard lock(mutex_);
    // A job that has ended meanwhile gets this answer, and no other one.
    if (!entry.ended) std::swap(entry.key, replaced);
    entry.model = loaded;
    entry.snapshot = snapshot;
    entry.stamp = stamp;
  }
  if (!replaced.empty() && replaced != entry.key) models_.devices().Drop(replaced);
  return ResidentModel{loadable.name, std::move(loaded), {job.scene, 0}, std::move(snapshot)};
}

std::optional<ResidentModel> JobSnapshots::FindResident(const JobRecord& job,
                                                        const Entry& entry) const {
  const std::lock_guard lock(mutex_);
  ModelCache::Handle model = entry.model.lock();
  if (model == nullptr) return std::nullopt;
  return ResidentModel{JobName(job.id), std::move(model), {job.scene, 0}, entry.snapshot};
}

std::shared_ptr<JobSnapshots::Entry> JobSnapshots::EntryOf(const std::string& job) {
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = entries_.find(job); found != entries_.end()) return found->second;
  }
  ForgetEnded();
  const std::lock_guard lock(mutex_);
  std::shared_ptr<Entry>& entry = entries_[job];
  if (entry == nullptr) entry = std::make_shared<Entry>();
  return entry;
}

void JobSnapshots::Forget(const std::string& job) {
  std::string key;
  {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(job);
    if (found == entries_.end()) return;
    key = found->second->key;
    found->second->ended = true;
    entries_.erase(found);
  }
  if (!key.empty()) models_.devices().Drop(key);
}

// A job that runs at another server may end unnoticed.
void JobSnapshots::ForgetEnded() {
  std::vector<std::string> jobs;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [job, entry] : entries_) jobs.push_back(job);
  }
  for (const std::string& id : jobs) {
    const absl::StatusOr<JobRecord> job = models_.store().jobs().GetJob(id);
    if (absl::IsNotFound(job.status()) || (job.ok() && IsTerminal(job->state))) Forget(id);
  }
}

JobFolder JobSnapshots::FolderOf(const std::string& job) const {
  return JobFolder(JobsFolder(models_.data_folder()) / job);
}

// A file with more bytes does not fit into memory as a part of a model.
int64_t JobSnapshots::MaxBytes() const {
  return models_.devices().all().front().cache->budget().usable().host;
}

}  // namespace pepeseg
