#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/store/layout.h"
#include "server/store/rows.h"

namespace pepeseg {

class Database;

// Scenes, datasets, jobs, models, labels, selections, keys and projects in SQL.
//
// Every call is one transaction, which is durable when the call returns. Calls block on the disk or
// the network: never make one from an RPC reaction. Thread safe; throws nothing. NOT_FOUND names
// what is missing. Any call may return the errors of Database::Transact.
//
// A create call that repeats the request_id of an earlier one of the same parent returns what the
// earlier call made, or ALREADY_EXISTS if the two calls ask for different things.
class Store {
 public:
  // Identity under which this store claims jobs.
  struct Holder {
    std::string name = "server";  // unique among the stores that are open at the same time
    absl::Duration lease = absl::InfiniteDuration();  // of a claimed job, from its last renewal
  };
  // `url`: as for Database::Open.
  static absl::StatusOr<std::unique_ptr<Store>> Open(const std::string& url, Holder holder);
  static absl::StatusOr<std::unique_ptr<Store>> Open(const std::string& url);
  ~Store();

  // Returns OK if the database answers.
  absl::Status Ping();
  struct Counts {
    std::map<JobState, int64_t> jobs;  // by state; states without jobs are absent
    int64_t num_scenes = 0, num_models = 0;
  };
  absl::StatusOr<Counts> CountAll();
  const Holder& holder() const { return holder_; }
  // Returns whether other servers may use the same database and change it between two calls.
  bool shared() const;

  // --- Scenes. All calls but these first three name a scene by its key.

  // Creates a scene from `id`, `display_name`, `request_id` (unique within the project) and
  // `project`. INVALID_ARGUMENT: the id is not IsResourceId, or the project is not an RFC 1034
  // label. ALREADY_EXISTS: a scene of the project has the id.
  absl::StatusOr<SceneRow> CreateScene(const SceneRow& scene);
  // Returns a scene's key. NOT_FOUND: the project has no scene with this id, even if others have.
  absl::StatusOr<std::string> FindScene(const std::string& project, const std::string& id);
  // Returns up to ten scenes with this id in all projects, ordered by project.
  absl::StatusOr<std::vector<SceneRow>> FindScenes(const std::string& id);
  absl::StatusOr<SceneRow> GetScene(const std::string& key);
  // Lists scenes by id. `project`: empty for all projects.
  absl::StatusOr<Page<SceneRow>> ListScenes(const PageRequest& page,
                                            const std::string& project = "");
  // Deletes a scene with all that belongs to it. FAILED_PRECONDITION: a job of it is active.
  absl::Status DeleteScene(const std::string& key);

  // --- Datasets and their files.

  // Creates an open dataset: an upload. `files` must have distinct paths and are not checked
  // further; `stored` of each says whether the project has the bytes already. `admit` decides
  // whether a new dataset may be made; it is not asked about one that the request_id made earlier,
  // and may be called more than once. RESOURCE_EXHAUSTED: the project's quota of stored bytes or
  // open uploads.
  absl::StatusOr<DatasetRow> CreateDataset(const std::string& scene, const std::string& request_id,
                                           const std::vector<DatasetFileRow>& files,
                                           const std::function<absl::Status()>& admit = {});
  absl::StatusOr<DatasetRow> GetDataset(const std::string& scene, int64_t number);
  // Lists sealed datasets by number.
  absl::StatusOr<Page<DatasetRow>> ListDatasets(const std::string& scene, const PageRequest& page);
  // Returns all files, ordered by path.
  absl::StatusOr<std::vector<DatasetFileRow>> ListDatasetFiles(const std::string& scene,
                                                               int64_t number);
  absl::StatusOr<DatasetFileRow> GetDatasetFile(const std::string& scene, int64_t number,
                                                const std::string& path);
  // Returns whether a dataset has a file of `kind` (pepeseg.v1.FileKind); false if the dataset does
  // not exist.
  absl::StatusOr<bool> HasFileOfKind(const std::string& scene, int64_t number, int kind);
  // Returns up to `limit` files with paths >= `path`, ordered by path; none if the dataset does not
  // exist.
  absl::StatusOr<std::vector<DatasetFileRow>> ListDatasetFilesFrom(const std::string& scene,
                                                                   int64_t number,
                                                                   const std::string& path,
                                                                   int64_t limit);
  // Records that the bytes of `files` are on the disk as blobs of the project. Reads path, sha256,
  // size and what the header says. FAILED_PRECONDITION: the upload is sealed. NOT_FOUND: it is
  // gone, or lacks one of the files. The blobs count in the project's usage even after these two
  // errors, since they are on the disk.
  absl::Status MarkFilesStored(const UploadName& upload, const std::vector<DatasetFileRow>& files);
  // Stores what the files' headers say.
  absl::Status SetFileHeaders(const std::string& scene, int64_t number,
                              const std::vector<DatasetFileRow>& files);
  // Sets `stored` of every file of the project with one of these digests, in sealed datasets too:
  // false when its bytes were found damaged, true when they were uploaded again. The headers of
  // these files become unread.
  absl::Status SetDigestsStored(const std::string& project, const std::vector<std::string>& digests,
                                bool stored);
  // Marks `found` as stored (files whose bytes came by another upload) and seals the dataset.
  // FAILED_PRECONDITION: files are not stored; names the first of them and their number. Sealing a
  // sealed dataset changes nothing.
  absl::StatusOr<DatasetRow> SealDataset(const std::string& scene, int64_t number,
                                         const std::vector<DatasetFileRow>& found = {});

  // Returns the open uploads that were created before a time.
  absl::StatusOr<std::vector<DatasetRow>> ListOpenUploads(absl::Time created_before);
  // Deletes an upload with its files. FAILED_PRECONDITION: it is sealed.
  absl::Status DeleteUpload(const std::string& scene, int64_t number);
  // Returns the digests of all files in datasets and uploads of the project.
  absl::StatusOr<std::set<std::string>> ListDigests(const std::string& project);
  // Returns the digests of all blobs that count in the project's usage.
  absl::StatusOr<std::set<std::string>> ListBlobs(const std::string& project);
  absl::StatusOr<std::vector<std::string>> ListBlobProjects();
  // Records that these blobs are no longer on the disk.
  absl::Status ForgetBlobs(const std::string& project, const std::vector<std::string>& digests);

  // --- Jobs.

  // Creates a queued job from scene, dataset, options, effective_options, request_id, host_bytes,
  // seconds and traceparent. ABORTED: the scene has an active job; names it. FAILED_PRECONDITION:
  // the dataset is not sealed. RESOURCE_EXHAUSTED: the project's quota of queued jobs or stored
  // bytes.
  absl::StatusOr<JobRow> CreateJob(const JobRow& job);
  absl::StatusOr<JobRow> GetJob(const std::string& id);
  struct JobFilter {
    std::string scene;              // empty: all scenes
    std::optional<JobState> state;  // nullopt: any state
    std::string project = {};       // empty: all projects
  };
  // Lists jobs, newest first.
  absl::StatusOr<Page<JobRow>> ListJobs(const JobFilter& filter, const PageRequest& page);
  // Returns the scene's QUEUED or RUNNING job, or nullopt.
  absl::StatusOr<std::optional<JobRow>> FindActiveJob(const std::string& scene);
  // Returns the number of the next job. No job of this database has had it or a higher one.
  absl::StatusOr<int64_t> NextJobNumber();

  // --- The queue. Writes of an attempt carry its fence: ABORTED if the job is not RUNNING under
  // this fence, or not held by this store.

  // Claims the oldest job that is QUEUED, or RUNNING with an expired lease. It becomes RUNNING on
  // `device` under the next fence, for the length of a lease. A job that a launcher still runs for
  // a holder whose lease has expired keeps its fence, device and launch: only its holder changes.
  // Passes over queued jobs that pause after a crash, and those of a project that runs as many jobs
  // as its quota allows. Returns nullopt if there is nothing to claim.
  absl::StatusOr<std::optional<JobRow>> ClaimJob(const std::string& device);
  // Renews the leases of the jobs that this store holds, and returns these jobs.
  absl::StatusOr<std::vector<JobRow>> RenewLeases();
  // Returns the RUNNING jobs of this store; changes nothing.
  absl::StatusOr<std::vector<JobRow>> ListHeldJobs();
  // Returns the RUNNING jobs of all holders.
  absl::StatusOr<std::vector<JobRow>> ListRunningJobs();
  // Makes this store the holder of a RUNNING job of `gone`, a holder that is known to have ended.
  // ABORTED: `gone` no longer holds it.
  absl::StatusOr<JobRow> TakeOverJob(const std::string& id, const std::string& gone);
  absl::Status SetJobLaunch(const std::string& id, int64_t fence, const std::string& launch);
  // Takes the next fence of a RUNNING job for a worker that its launcher has started again. Any
  // process may call this, whoever holds the job. ABORTED: the job no longer runs under this
  // launch.
  absl::StatusOr<int64_t> TakeNextFence(const std::string& id, const std::string& launch);
  absl::Status SetJobStage(const std::string& id, int64_t fence, const std::string& stage);
  // Cancels a QUEUED job at once, records the request for a RUNNING one, and leaves an ended job
  // unchanged.
  absl::StatusOr<JobRow> RequestCancel(const std::string& id);
  // RUNNING -> QUEUED, or CANCELLED if that was requested. Sets `crashes` and `server_ends` to 0
  // after an attempt with progress; else adds one to the counter that matches the attempt's end.
  absl::StatusOr<JobRow> RequeueJob(const std::string& id, int64_t fence,
                                    const EndedAttempt& attempt);
  // RUNNING -> FAILED with the code and message of `error`, or CANCELLED if that is its code.
  absl::StatusOr<JobRow> EndJob(const std::string& id, int64_t fence, const absl::Status& error);
  // RUNNING -> SUCCEEDED, and makes the job's model the scene's live one, in one transaction. Reads
  // folder, metrics, sources, num_gaussians and num_bytes of the model.
  absl::StatusOr<ModelRow> CommitModel(const std::string& id, int64_t fence, const ModelRow& model);

  // --- Models.

  absl::StatusOr<ModelRow> GetModel(const std::string& scene, int64_t number);
  // Returns the scene's newest model. FAILED_PRECONDITION: there is none; names the active job.
  absl::StatusOr<ModelRow> GetLiveModel(const std::string& scene);
  // Lists models, newest first.
  absl::StatusOr<Page<ModelRow>> ListModels(const std::string& scene, const PageRequest& page);
  // Deletes a model with its selections.
  absl::Status DeleteModel(const std::string& scene, int64_t number);

  // --- Labels.

  // Creates a label from all fields but create_time; checks the id only. INVALID_ARGUMENT: the id
  // is not IsResourceId. ALREADY_EXISTS: a label of another request has the id.
  absl::StatusOr<LabelRow> CreateLabel(const LabelRow& label);
  // NOT_FOUND also names up to 20 labels of the scene.
  absl::StatusOr<LabelRow> GetLabel(const std::string& scene, const std::string& id);
  // Lists labels by id.
  absl::StatusOr<Page<LabelRow>> ListLabels(const std::string& scene, const PageRequest& page);
  absl::Status DeleteLabel(const std::string& scene, const std::string& id);

  // --- Selections. A selection's file is written before its record, and both are named by a number
  // that is taken first.

  absl::StatusOr<int64_t> TakeSelectionNumber(const std::string& scene);
  // Returns what an earlier CreateSelection with this request_id made, so that a retry need not
  // compute it again; nullopt if there was none or request_id is empty. ALREADY_EXISTS: the earlier
  // one has another digest.
  absl::StatusOr<std::optional<SelectionRow>> FindSelectionOfRequest(
      const std::string& scene, const std::string& request_id, const std::string& request_digest);
  // Creates a selection from all fields but create_time. If the returned number differs from the
  // given one, it is that of a selection that the same request_id made meanwhile. NOT_FOUND: the
  // model or the base is gone. RESOURCE_EXHAUSTED: the project's quota of stored bytes.
  absl::StatusOr<SelectionRow> CreateSelection(const SelectionRow& selection);
  absl::StatusOr<SelectionRow> GetSelection(const std::string& scene, int64_t number);
  // Lists selections, newest first.
  absl::StatusOr<Page<SelectionRow>> ListSelections(const std::string& scene,
                                                    const PageRequest& page);
  // Deletes a selection; those made from it stay.
  absl::Status DeleteSelection(const std::string& scene, int64_t number);

  // --- Projects, keys and quotas.

  // Return the owning project. NOT_FOUND; INVALID_ARGUMENT for an id that no scene or job can have.
  absl::StatusOr<std::string> ProjectOfScene(const std::string& key);
  absl::StatusOr<std::string> ProjectOfJob(const std::string& id);

  // Creates a key from all fields but create_time and revoke_time, and its project if there is
  // none. ABORTED: the id or the digest is taken. INVALID_ARGUMENT: the project is not an RFC 1034
  // label.
  absl::StatusOr<KeyRow> CreateKey(const KeyRow& key);
  // Returns expired and revoked keys, too.
  absl::StatusOr<KeyRow> FindKeyByDigest(const std::string& sha256);
  // Lists keys by id, expired and revoked ones included. `project`: empty for all projects.
  absl::StatusOr<Page<KeyRow>> ListKeys(const std::string& project, const PageRequest& page);
  // Revokes a key. The time of the first revocation stays.
  absl::StatusOr<KeyRow> RevokeKey(const std::string& id);

  // Returns a project; one without a record has no quota of its own.
  absl::StatusOr<ProjectRow> GetProject(const std::string& id);
  // Sets a project's quota, and creates the project if there is none. INVALID_ARGUMENT: the id is
  // not an RFC 1034 label.
  absl::StatusOr<ProjectRow> SetProjectQuota(const std::string& id, const Quota& quota);
  // Returns stored_bytes, open_uploads, queued_jobs and running_jobs as the quota counts them.
  absl::StatusOr<Quota> GetUsage(const std::string& project);
  // Sets the limits of projects without values of their own. Not thread safe: call it before any
  // other call, or while none is in progress.
  void SetDefaultQuota(const Quota& quota) { default_quota_ = quota; }
  const Quota& default_quota() const { return default_quota_; }

 private:
  Store(std::unique_ptr<Database> database, Holder holder);
  std::unique_ptr<Database> database_;
  const Holder holder_;
  Quota default_quota_;
};

}  // namespace pepeseg
