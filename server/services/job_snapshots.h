#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/services/model_loader.h"
#include "server/worker_protocol/snapshot_file.h"

namespace pepeseg {

// Loads what queries name: a model, or a job, whose newest snapshot answers while it trains
// (proto/pepeseg/v1/snapshot.proto). At most one snapshot of a job is in memory, within the budget
// of the models; a newer one takes its place at the first query after it was written. While one
// call loads it, the older one answers the others. A file that is damaged, or of another job, is
// not used: the older snapshot stays. Thread safe; calls block on the store and on files.
class JobSnapshots {
 public:
  // `models` must outlive it. `scratch`: folder for copies of files that workers write, made if it
  // is missing.
  JobSnapshots(ModelLoader& models, std::filesystem::path scratch)
      : models_(models), scratch_(std::move(scratch)) {}

  // Returns the model that `name` names, with the errors of ModelLoader::Load, or that of a job.
  // That is its newest snapshot, or the model that it has made. UNAVAILABLE, with a time to retry:
  // the job has no snapshot yet. FAILED_PRECONDITION: the job has ended without a model. NOT_FOUND:
  // no job has this name.
  absl::StatusOr<ResidentModel> Load(const NamedScenes& scenes, const std::string& name,
                                     const std::string& field);
  // In addition to the errors of Load, FAILED_PRECONDITION: see CheckFeatures.
  absl::StatusOr<ResidentModel> LoadWithFeatures(const NamedScenes& scenes, const std::string& name,
                                                 const std::string& field);
  // Frees the snapshot of a job that has ended. Does not block.
  void Forget(const std::string& job);

 private:
  // The snapshot of a job that was loaded last.
  struct Entry {
    std::mutex loading;  // held while a newer one is loaded
    // Guarded by mutex_.
    std::string key;                        // in the cache; empty: none was loaded yet
    std::weak_ptr<const SceneModel> model;  // expired: it was evicted
    v1::Snapshot snapshot;                  // describes it
    std::optional<SnapshotStamp> stamp;     // of its file
    std::optional<SnapshotStamp> unusable;  // of a file that cannot be used
    bool ended = false;                     // Forget() was called
  };

  absl::StatusOr<ResidentModel> LoadModelOf(const JobRecord& job);
  absl::StatusOr<ResidentModel> LoadNewest(const JobRecord& job);
  absl::StatusOr<ResidentModel> LoadFile(const JobRecord& job, const SnapshotStamp& stamp,
                                         const ResidentModel* older, Entry& entry);
  // Returns the snapshot that is in memory.
  std::optional<ResidentModel> FindResident(const JobRecord& job, const Entry& entry) const;
  std::shared_ptr<Entry> EntryOf(const std::string& job);
  // Forgets the jobs that have ended.
  void ForgetEnded();
  JobFolder FolderOf(const std::string& job) const;
  int64_t MaxBytes() const;

  ModelLoader& models_;
  const std::filesystem::path scratch_;
  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Entry>> entries_;  // by job; guarded by mutex_
};

}  // namespace pepeseg
