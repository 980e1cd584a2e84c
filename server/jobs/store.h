#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/jobs/rows.h"

namespace pepeseg {

class Database;

// Scenes, datasets, jobs, models, labels and selections in SQL. Every call is one transaction,
// durable when it returns, and blocks on the disk: never call one from an RPC reaction. Thread
// safe. NOT_FOUND names what is missing; nothing throws.
//
// A create call with the request_id of an earlier one of its parent answers what that one made, or
// ALREADY_EXISTS when the two asked for different things.
class Store {
 public:
  // "sqlite:PATH" (made when it is not there) or "sqlite::memory:".
  static absl::StatusOr<std::unique_ptr<Store>> Open(const std::string& url);
  ~Store();

  // Whether the database answers.
  absl::Status Ping();
  struct Counts {
    std::map<JobState, int64_t> jobs;  // of each state that any is in
    int64_t num_scenes = 0, num_models = 0;
  };
  absl::StatusOr<Counts> CountAll();

  // INVALID_ARGUMENT: id is not an RFC 1034 label; ALREADY_EXISTS. Reads id, display_name and
  // request_id.
  absl::StatusOr<SceneRow> CreateScene(const SceneRow& scene);
  absl::StatusOr<SceneRow> GetScene(const std::string& id);
  absl::StatusOr<Page<SceneRow>> ListScenes(const PageRequest& page);  // by id
  // With all that belongs to it. FAILED_PRECONDITION while a job of it is active.
  absl::Status DeleteScene(const std::string& id);

  // `files`: with distinct paths; `stored` is kept as given. Checks nothing else of them.
  absl::StatusOr<DatasetRow> CreateDataset(const std::string& scene, const std::string& request_id,
                                           const std::vector<DatasetFileRow>& files);
  absl::StatusOr<DatasetRow> GetDataset(const std::string& scene, int64_t number);
  // Sealed ones, by number.
  absl::StatusOr<Page<DatasetRow>> ListDatasets(const std::string& scene, const PageRequest& page);
  // By path.
  absl::StatusOr<std::vector<DatasetFileRow>> ListDatasetFiles(const std::string& scene,
                                                               int64_t number);
  absl::StatusOr<DatasetFileRow> GetDatasetFile(const std::string& scene, int64_t number,
                                                const std::string& path);
  // FAILED_PRECONDITION on a sealed dataset.
  absl::Status MarkFileStored(const std::string& scene, int64_t number, const std::string& path);
  // FAILED_PRECONDITION names the first file that is not stored, and how many are not. Sealing a
  // sealed dataset changes nothing.
  absl::StatusOr<DatasetRow> SealDataset(const std::string& scene, int64_t number);

  // Reads scene, dataset, options, effective_options and request_id. ABORTED names the scene's
  // active job when there is one; FAILED_PRECONDITION on an open dataset.
  absl::StatusOr<JobRow> CreateJob(const JobRow& job);
  absl::StatusOr<JobRow> GetJob(const std::string& id);
  struct JobFilter {
    std::string scene;              // empty: of all scenes
    std::optional<JobState> state;  // none: in any state
  };
  absl::StatusOr<Page<JobRow>> ListJobs(const JobFilter& filter,
                                        const PageRequest& page);  // newest first
  absl::StatusOr<std::optional<JobRow>> FindActiveJob(const std::string& scene);

  // The queue. Writes of an attempt carry its fence: ABORTED when the job is not RUNNING under it.
  // Takes the oldest QUEUED job and makes it RUNNING on `device` with the next fence.
  absl::StatusOr<std::optional<JobRow>> ClaimJob(const std::string& device);
  absl::StatusOr<std::vector<JobRow>> ListRunningJobs();
  absl::Status SetJobStage(const std::string& id, int64_t fence, const std::string& stage);
  // A QUEUED job is CANCELLED at once; of a RUNNING one the wish is noted; else nothing changes.
  absl::StatusOr<JobRow> RequestCancel(const std::string& id);
  // RUNNING -> QUEUED, or CANCELLED when that was asked for.
  absl::StatusOr<JobRow> RequeueJob(const std::string& id, int64_t fence);
  // RUNNING -> FAILED (with the code and message of `error`), or CANCELLED when that is its code.
  absl::StatusOr<JobRow> EndJob(const std::string& id, int64_t fence, const absl::Status& error);
  // RUNNING -> SUCCEEDED and its model live, in one transaction. Reads folder, metrics,
  // num_gaussians and num_bytes of the model.
  absl::StatusOr<ModelRow> CommitModel(const std::string& id, int64_t fence, const ModelRow& model);

  absl::StatusOr<ModelRow> GetModel(const std::string& scene, int64_t number);
  // FAILED_PRECONDITION when the scene has none; names its active job.
  absl::StatusOr<ModelRow> GetLiveModel(const std::string& scene);
  absl::StatusOr<Page<ModelRow>> ListModels(const std::string& scene,
                                            const PageRequest& page);  // newest first
  // With its selections.
  absl::Status DeleteModel(const std::string& scene, int64_t number);

  // INVALID_ARGUMENT: id is not an RFC 1034 label; ALREADY_EXISTS: another request's label has it.
  // Checks nothing else. Reads all but create_time.
  absl::StatusOr<LabelRow> CreateLabel(const LabelRow& label);
  // NOT_FOUND also names labels that the scene has.
  absl::StatusOr<LabelRow> GetLabel(const std::string& scene, const std::string& id);
  absl::StatusOr<Page<LabelRow>> ListLabels(const std::string& scene,
                                            const PageRequest& page);  // by id
  absl::Status DeleteLabel(const std::string& scene, const std::string& id);

  // A selection's file is written before its row, and both are named by a number taken first.
  absl::StatusOr<int64_t> TakeSelectionNumber(const std::string& scene);
  // What an earlier CreateSelection with this request_id made, so that a retry need not compute it
  // again; none when request_id is empty. ALREADY_EXISTS: of another digest.
  absl::StatusOr<std::optional<SelectionRow>> FindSelectionOfRequest(
      const std::string& scene, const std::string& request_id, const std::string& request_digest);
  // Reads all but create_time. NOT_FOUND: the model or the base is gone. When the answer has
  // another number, it is what the request_id made meanwhile.
  absl::StatusOr<SelectionRow> CreateSelection(const SelectionRow& selection);
  absl::StatusOr<SelectionRow> GetSelection(const std::string& scene, int64_t number);
  absl::StatusOr<Page<SelectionRow>> ListSelections(const std::string& scene,
                                                    const PageRequest& page);  // newest first
  // Those made from it stay.
  absl::Status DeleteSelection(const std::string& scene, int64_t number);

 private:
  explicit Store(std::unique_ptr<Database> database);
  std::unique_ptr<Database> database_;
};

}  // namespace pepeseg
