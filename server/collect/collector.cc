#include "server/collect/collector.h"

#include <spdlog/spdlog.h>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/collect/collection.h"
#include "server/data/locked_file.h"
#include "server/store/layout.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr absl::Duration kInterval = absl::Hours(1);

// Returns 12 for a folder "j12", and 0 for one that is not a job's.
int64_t JobNumberOf(const fs::path& folder) {
  const std::string name = folder.filename().string();
  int64_t number = 0;
  if (!name.starts_with('j') || !absl::SimpleAtoi(name.substr(1), &number)) return 0;
  return absl::StrCat("j", number) == name ? number : 0;
}

// Returns FAILED_PRECONDITION if the directory has a job that the database never had. Next to an
// empty database, everything in a full directory would look unreferenced and would be removed.
absl::Status CheckDatabase(const Collection& collection) {
  ASSIGN_OR_RETURN(const int64_t next, collection.store.jobs().NextJobNumber());
  for (const fs::path& folder : EntriesOf(JobsFolder(collection.options.data))) {
    if (JobNumberOf(folder) < next) continue;
    return absl::FailedPreconditionError(
        absl::StrCat(folder.string(),
                     ": the database has never had this job, so it may belong to another data "
                     "directory. Nothing is collected"));
  }
  return absl::OkStatus();
}

// Removes the working files of a job that has ended. Its logs stay, and its model as long as the
// model has a record.
absl::Status CollectAttempts(Collection& collection, const JobRecord& job, const fs::path& folder) {
  std::string keep;
  if (job.model != 0) {
    const absl::StatusOr<ModelRecord> model =
        collection.store.models().GetModel(job.scene, job.model);
    if (!model.ok() && !absl::IsNotFound(model.status())) return model.status();
    if (model.ok()) keep = fs::path(model->folder).filename().string();
  }
  const Collected before = MeasureFolder(folder);
  JobFolder(folder).RemoveWorkingFiles(keep);
  const Collected after = MeasureFolder(folder);
  collection.collected.num_files += before.num_files - after.num_files;
  collection.collected.num_bytes += before.num_bytes - after.num_bytes;
  return absl::OkStatus();
}

absl::Status CollectJobs(Collection& collection) {
  for (const fs::path& folder : EntriesOf(JobsFolder(collection.options.data))) {
    if (JobNumberOf(folder) == 0) continue;
    const absl::StatusOr<JobRecord> job =
        collection.store.jobs().GetJob(folder.filename().string());
    if (absl::IsNotFound(job.status())) {
      collection.RemoveAll(folder);
      continue;
    }
    RETURN_IF_ERROR(job.status());
    // An active job's working files belong to its attempts, of which a later one may resume.
    if (IsTerminal(job->state)) RETURN_IF_ERROR(CollectAttempts(collection, *job, folder));
  }
  return absl::OkStatus();
}

// Removes the files and folders of `folder` without a record, as has_record(scene, number) returns
// it. The folder has a folder for each scene, with entries named by a number. A file is written
// before its record, so only files of at least options.file_age are removed.
template <typename HasRecord>
absl::Status CollectNumbered(Collection& collection, const fs::path& folder, HasRecord has_record) {
  for (const fs::path& of_scene : EntriesOf(folder)) {
    SceneRef scene;
    if (!absl::SimpleAtoi(of_scene.filename().string(), &scene.id)) continue;
    for (const fs::path& file : EntriesOf(of_scene)) {
      int64_t number = 0;
      if (!absl::SimpleAtoi(file.stem().string(), &number)) continue;
      if (AgeOf(file) < collection.options.file_age) continue;
      const absl::Status record = has_record(scene, number);
      if (absl::IsNotFound(record)) {
        fs::is_directory(fs::symlink_status(file)) ? collection.RemoveAll(file)
                                                   : collection.Remove(file);
      } else {
        RETURN_IF_ERROR(record);
      }
    }
    std::error_code ignored;
    fs::remove(of_scene, ignored);  // fails unless it is empty
  }
  return absl::OkStatus();
}

absl::Status CollectAll(Collection& collection) {
  Store& store = collection.store;
  const fs::path& data = collection.options.data;
  RETURN_IF_ERROR(CheckDatabase(collection));
  // Records of old uploads first, then the files that have lost their record by that.
  RETURN_IF_ERROR(CollectUploads(collection));
  RETURN_IF_ERROR(CollectPartial(collection));
  RETURN_IF_ERROR(CollectBlobs(collection));
  CollectDamaged(collection);
  RETURN_IF_ERROR(CollectJobs(collection));
  RETURN_IF_ERROR(CollectNumbered(collection, SelectionsFolder(data),
                                  [&](const SceneRef& scene, int64_t number) {
                                    return store.selections().GetSelection(scene, number).status();
                                  }));
  RETURN_IF_ERROR(CollectNumbered(collection, ModelVersionsFolder(data),
                                  [&](const SceneRef& scene, int64_t number) {
                                    return store.models().GetModel(scene, number).status();
                                  }));
  RETURN_IF_ERROR(
      CollectNumbered(collection, DatasetsFolder(data), [&](const SceneRef& scene, int64_t number) {
        return store.datasets().GetDataset(scene, number).status();
      }));
  CollectTemporaries(collection);
  return absl::OkStatus();
}

}  // namespace

Collector::Collector(Store& store, CollectorOptions options)
    : store_(store), options_(std::move(options)) {}

Collector::~Collector() { Stop(); }

void Collector::Start() {
  thread_ = std::thread([this] { RunForever(); });
}

void Collector::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

absl::StatusOr<Collected> Collector::Run() {
  // ABORTED: another server on the data directory collects just now.
  ASSIGN_OR_RETURN(const LockedFile alone, LockedFile::TryAlone(CollectorLockPath(options_.data)));
  Collection collection{store_, options_, made_, {}};
  RETURN_IF_ERROR(CollectAll(collection));
  return collection.collected;
}

void Collector::RunForever() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    lock.unlock();
    const absl::StatusOr<Collected> run = Run();
    if (run.ok() && run->num_files > 0) {
      spdlog::info("collected {} files that nothing refers to, {} MiB; {} uploads given up",
                   run->num_files, run->num_bytes >> 20, run->num_uploads);
    } else if (!run.ok() && !absl::IsAborted(run.status())) {
      spdlog::error("collecting what nothing refers to: {}", run.status().ToString());
    }
    lock.lock();
    wake_.wait_for(lock, absl::ToChronoMilliseconds(kInterval), [this] { return stopping_; });
  }
}

}  // namespace pepeseg
