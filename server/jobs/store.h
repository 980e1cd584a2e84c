#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/jobs/rows.h"

namespace pepeseg {

class Database;

// Scenes, datasets, jobs and models in SQL. Every call is one transaction, durable when it returns,
// and blocks on the disk: never call one from an RPC reaction. Thread safe. NOT_FOUND names what is
// missing; nothing throws.
//
// A create call with the request_id of an earlier one of its parent answers what that one made, or
// ALREADY_EXISTS when the two asked for different things.
class Store {
 public:
  // "sqlite:PATH" (made when it is not there) or "sqlite::memory:".
  static absl::StatusOr<std::unique_ptr<Store>> Open(std::string_view url);
  ~Store();

  // INVALID_ARGUMENT: id is not an RFC 1034 label; ALREADY_EXISTS. Reads id, display_name and
  // request_id.
  absl::StatusOr<SceneRow> CreateScene(const SceneRow& scene);
  absl::StatusOr<SceneRow> GetScene(std::string_view id);
  absl::StatusOr<Page<SceneRow>> ListScenes(const PageRequest& page);  // by id
  // With its datasets, jobs and models. FAILED_PRECONDITION while a job of it is active.
  absl::Status DeleteScene(std::string_view id);

  // `files`: with distinct paths; `stored` is kept as given. Checks nothing else of them.
  absl::StatusOr<DatasetRow> CreateDataset(std::string_view scene, std::string_view request_id,
                                           const std::vector<DatasetFileRow>& files);
  absl::StatusOr<DatasetRow> GetDataset(std::string_view scene, int64_t number);
  absl::StatusOr<Page<DatasetRow>> ListDatasets(std::string_view scene, const PageRequest& page);
  // By path.
  absl::StatusOr<std::vector<DatasetFileRow>> ListDatasetFiles(std::string_view scene,
                                                               int64_t number);
  absl::StatusOr<DatasetFileRow> GetDatasetFile(std::string_view scene, int64_t number,
                                                std::string_view path);
  // FAILED_PRECONDITION on a sealed dataset.
  absl::Status MarkFileStored(std::string_view scene, int64_t number, std::string_view path);
  // FAILED_PRECONDITION names the first file that is not stored, and how many are not. Sealing a
  // sealed dataset changes nothing.
  absl::StatusOr<DatasetRow> SealDataset(std::string_view scene, int64_t number);

  // Reads scene, dataset, options, effective_options and request_id. ABORTED names the scene's
  // active job when there is one; FAILED_PRECONDITION on an open dataset.
  absl::StatusOr<JobRow> CreateJob(const JobRow& job);
  absl::StatusOr<JobRow> GetJob(std::string_view id);
  struct JobFilter {
    std::string scene;              // empty: of all scenes
    std::optional<JobState> state;  // none: in any state
  };
  absl::StatusOr<Page<JobRow>> ListJobs(const JobFilter& filter,
                                        const PageRequest& page);  // newest first
  absl::StatusOr<std::optional<JobRow>> FindActiveJob(std::string_view scene);

  // The queue. Writes of an attempt carry its fence: ABORTED when the job is not RUNNING under it.
  // Takes the oldest QUEUED job and makes it RUNNING with the next fence.
  absl::StatusOr<std::optional<JobRow>> ClaimJob();
  absl::Status SetJobStage(std::string_view id, int64_t fence, std::string_view stage);
  // A QUEUED job is CANCELLED at once; of a RUNNING one the wish is noted; else nothing changes.
  absl::StatusOr<JobRow> RequestCancel(std::string_view id);
  // RUNNING -> QUEUED, or CANCELLED when that was asked for.
  absl::StatusOr<JobRow> RequeueJob(std::string_view id, int64_t fence);
  // RUNNING -> FAILED (with the code and message of `error`), or CANCELLED when that is its code.
  absl::StatusOr<JobRow> EndJob(std::string_view id, int64_t fence, const absl::Status& error);
  // RUNNING -> SUCCEEDED and its model live, in one transaction. Reads folder, metrics,
  // num_gaussians and num_bytes of the model.
  absl::StatusOr<ModelRow> CommitModel(std::string_view id, int64_t fence, const ModelRow& model);

  absl::StatusOr<ModelRow> GetModel(std::string_view scene, int64_t number);
  // FAILED_PRECONDITION when the scene has none; names its active job.
  absl::StatusOr<ModelRow> GetLiveModel(std::string_view scene);
  absl::StatusOr<Page<ModelRow>> ListModels(std::string_view scene,
                                            const PageRequest& page);  // newest first
  absl::Status DeleteModel(std::string_view scene, int64_t number);

 private:
  explicit Store(std::unique_ptr<Database> database);
  std::unique_ptr<Database> database_;
};

}  // namespace pepeseg
