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

// Scenes, datasets, jobs, models, labels, selections and keys in SQL. Every call is one
// transaction, durable when it returns, and blocks on the disk: never call one from an RPC
// reaction. Thread safe. NOT_FOUND names what is missing; nothing throws.
//
// A create call with the request_id of an earlier one of its parent answers what that one made, or
// ALREADY_EXISTS when the two asked for different things.
class Store {
 public:
  // Whose the claims of this store are.
  struct Holder {
    std::string name = "server";  // no two that are open at a time have the same
    absl::Duration lease = absl::InfiniteDuration();
  };
  // `url`: Database::Open's.
  static absl::StatusOr<std::unique_ptr<Store>> Open(const std::string& url, Holder holder);
  static absl::StatusOr<std::unique_ptr<Store>> Open(const std::string& url);
  ~Store();

  // Whether the database answers.
  absl::Status Ping();
  struct Counts {
    std::map<JobState, int64_t> jobs;  // of each state that any is in
    int64_t num_scenes = 0, num_models = 0;
  };
  absl::StatusOr<Counts> CountAll();
  const Holder& holder() const { return holder_; }
  // Other servers may be on the same database: what this one did not do may have happened.
  bool shared() const;

  // INVALID_ARGUMENT: id is not IsResourceId, or project is not an RFC 1034 label; ALREADY_EXISTS:
  // a scene of the project has the id. Reads id, display_name, request_id, which is the project's
  // own, and project. All other calls name a scene by its key.
  absl::StatusOr<SceneRow> CreateScene(const SceneRow& scene);
  // Its key. NOT_FOUND: the project has no scene of this id, whoever else has.
  absl::StatusOr<std::string> FindScene(const std::string& project, const std::string& id);
  // Those of this id in all projects, by project; at most ten.
  absl::StatusOr<std::vector<SceneRow>> FindScenes(const std::string& id);
  absl::StatusOr<SceneRow> GetScene(const std::string& key);
  // By id; of a project, or of all (empty).
  absl::StatusOr<Page<SceneRow>> ListScenes(const PageRequest& page,
                                            const std::string& project = "");
  // With all that belongs to it. FAILED_PRECONDITION while a job of it is active.
  absl::Status DeleteScene(const std::string& key);

  // `files`: with distinct paths; `stored`, true where the project has the bytes, is kept as given.
  // Checks nothing else of them. RESOURCE_EXHAUSTED: the project's quota of stored bytes or open
  // uploads. `admit`, which may be asked more than once, decides over a new one, not over one that
  // the request_id made earlier.
  absl::StatusOr<DatasetRow> CreateDataset(const std::string& scene, const std::string& request_id,
                                           const std::vector<DatasetFileRow>& files,
                                           const std::function<absl::Status()>& admit = {});
  absl::StatusOr<DatasetRow> GetDataset(const std::string& scene, int64_t number);
  // Sealed ones, by number.
  absl::StatusOr<Page<DatasetRow>> ListDatasets(const std::string& scene, const PageRequest& page);
  // By path.
  absl::StatusOr<std::vector<DatasetFileRow>> ListDatasetFiles(const std::string& scene,
                                                               int64_t number);
  absl::StatusOr<DatasetFileRow> GetDatasetFile(const std::string& scene, int64_t number,
                                                const std::string& path);
  // `kind`: pepeseg.v1.FileKind. False also for a dataset that does not exist.
  absl::StatusOr<bool> HasFileOfKind(const std::string& scene, int64_t number, int kind);
  // Up to `limit` files from `path` on, by path.
  absl::StatusOr<std::vector<DatasetFileRow>> ListDatasetFilesFrom(const std::string& scene,
                                                                   int64_t number,
                                                                   const std::string& path,
                                                                   int64_t limit);
  // In one transaction: the files' bytes are on the disk as blobs of the project. Reads path,
  // sha256, size and what the header says. FAILED_PRECONDITION: the upload is sealed; NOT_FOUND: it
  // is gone, or has no such file. The blobs count in the project's usage also then.
  absl::Status MarkFilesStored(const UploadName& upload, const std::vector<DatasetFileRow>& files);
  // Keeps what the files' headers say.
  absl::Status SetFileHeaders(const std::string& scene, int64_t number,
                              const std::vector<DatasetFileRow>& files);
  // Of every file of the project with one of these digests, also in sealed datasets: its bytes were
  // found damaged, or were brought again. Their headers are read again.
  absl::Status SetDigestsStored(const std::string& project, const std::vector<std::string>& digests,
                                bool stored);
  // In one transaction with marking `found` as stored, whose bytes came otherwise.
  // FAILED_PRECONDITION names the first file that is not stored, and how many are not. Sealing a
  // sealed dataset changes nothing.
  absl::StatusOr<DatasetRow> SealDataset(const std::string& scene, int64_t number,
                                         const std::vector<DatasetFileRow>& found = {});

  // Those that are open and older than that.
  absl::StatusOr<std::vector<DatasetRow>> ListOpenUploads(absl::Time created_before);
  // With its files. FAILED_PRECONDITION: it is sealed.
  absl::Status DeleteUpload(const std::string& scene, int64_t number);
  // Of all files that datasets and uploads of the project name.
  absl::StatusOr<std::set<std::string>> ListDigests(const std::string& project);
  // Of all blobs that count in the project's usage.
  absl::StatusOr<std::set<std::string>> ListBlobs(const std::string& project);
  absl::StatusOr<std::vector<std::string>> ListBlobProjects();
  // They are not on the disk any more.
  absl::Status ForgetBlobs(const std::string& project, const std::vector<std::string>& digests);

  // Reads scene, dataset, options, effective_options, request_id, host_bytes and seconds. ABORTED
  // names the scene's active job when there is one; FAILED_PRECONDITION on an open dataset;
  // RESOURCE_EXHAUSTED: the project's quota of queued jobs or stored bytes.
  absl::StatusOr<JobRow> CreateJob(const JobRow& job);
  absl::StatusOr<JobRow> GetJob(const std::string& id);
  struct JobFilter {
    std::string scene;              // empty: of all scenes
    std::optional<JobState> state;  // none: in any state
    std::string project = {};       // empty: of all projects
  };
  absl::StatusOr<Page<JobRow>> ListJobs(const JobFilter& filter,
                                        const PageRequest& page);  // newest first
  absl::StatusOr<std::optional<JobRow>> FindActiveJob(const std::string& scene);
  // No job of this database has had this number, or a higher one.
  absl::StatusOr<int64_t> NextJobNumber();

  // The queue. Writes of an attempt carry its fence: ABORTED when the job is not RUNNING under it,
  // or not held by this store.
  // Takes the oldest job that is QUEUED, or RUNNING with a lease that is over, and makes it RUNNING
  // on `device` with the next fence, for the length of a lease. One that a launcher still runs for
  // a holder whose lease is over keeps its fence and launch: it changes its holder only.
  // Queued jobs of a project that runs as many as its quota allows are passed over, and those that
  // pause after a crash.
  absl::StatusOr<std::optional<JobRow>> ClaimJob(const std::string& device);
  // Prolongs the leases of what this store holds, and answers those jobs.
  absl::StatusOr<std::vector<JobRow>> RenewLeases();
  // RUNNING ones of this store, unchanged.
  absl::StatusOr<std::vector<JobRow>> ListHeldJobs();
  // RUNNING ones of all.
  absl::StatusOr<std::vector<JobRow>> ListRunningJobs();
  // Makes a RUNNING job of another holder, which is known to be gone, this store's.
  absl::StatusOr<JobRow> TakeOverJob(const std::string& id, const std::string& gone);
  absl::Status SetJobLaunch(const std::string& id, int64_t fence, const std::string& launch);
  // The next fence of a RUNNING job for the worker that its launcher has started again; whoever
  // holds it. ABORTED: the job does not run under this launch any more.
  absl::StatusOr<int64_t> TakeNextFence(const std::string& id, const std::string& launch);
  absl::Status SetJobStage(const std::string& id, int64_t fence, const std::string& stage);
  // A QUEUED job is CANCELLED at once; of a RUNNING one the wish is noted; else nothing changes.
  absl::StatusOr<JobRow> RequestCancel(const std::string& id);
  // RUNNING -> QUEUED, or CANCELLED when that was asked for. Progress sets `crashes` and
  // `server_ends` to 0; without it the one that the attempt's end belongs to rises by one.
  absl::StatusOr<JobRow> RequeueJob(const std::string& id, int64_t fence,
                                    const EndedAttempt& attempt);
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

  // INVALID_ARGUMENT: id is not IsResourceId; ALREADY_EXISTS: another request's label has it.
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
  // Reads all but create_time. NOT_FOUND: the model or the base is gone. RESOURCE_EXHAUSTED: the
  // project's quota of stored bytes. When the answer has another number, it is what the request_id
  // made meanwhile.
  absl::StatusOr<SelectionRow> CreateSelection(const SelectionRow& selection);
  absl::StatusOr<SelectionRow> GetSelection(const std::string& scene, int64_t number);
  absl::StatusOr<Page<SelectionRow>> ListSelections(const std::string& scene,
                                                    const PageRequest& page);  // newest first
  // Those made from it stay.
  absl::Status DeleteSelection(const std::string& scene, int64_t number);

  // Whose it is; NOT_FOUND, and INVALID_ARGUMENT for an id that no scene or job can have.
  absl::StatusOr<std::string> ProjectOfScene(const std::string& key);
  absl::StatusOr<std::string> ProjectOfJob(const std::string& id);

  // Reads all but create_time and revoke_time, and makes the project when it is not there. ABORTED:
  // the id or the digest is taken. INVALID_ARGUMENT: the project is not an RFC 1034 label.
  absl::StatusOr<KeyRow> CreateKey(const KeyRow& key);
  // Expired and revoked ones, too.
  absl::StatusOr<KeyRow> FindKeyByDigest(const std::string& sha256);
  // By id; of a project, or of all (empty). Expired and revoked ones, too.
  absl::StatusOr<Page<KeyRow>> ListKeys(const std::string& project, const PageRequest& page);
  // Keeps the time of the first revocation.
  absl::StatusOr<KeyRow> RevokeKey(const std::string& id);

  // A project that has no row yet has no quota of its own.
  absl::StatusOr<ProjectRow> GetProject(const std::string& id);
  // Makes the project when it is not there. INVALID_ARGUMENT: id is not an RFC 1034 label.
  absl::StatusOr<ProjectRow> SetProjectQuota(const std::string& id, const Quota& quota);
  // stored_bytes, open_uploads, queued_jobs and running_jobs as they count against the quota.
  absl::StatusOr<Quota> GetUsage(const std::string& project);
  // Of projects without a value of their own. Before any other call, or while there is none.
  void SetDefaultQuota(const Quota& quota) { default_quota_ = quota; }
  const Quota& default_quota() const { return default_quota_; }

 private:
  Store(std::unique_ptr<Database> database, Holder holder);
  std::unique_ptr<Database> database_;
  const Holder holder_;
  Quota default_quota_;
};

}  // namespace pepeseg
