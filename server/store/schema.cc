#include "server/store/schema.h"

#include <cassert>

namespace pepeseg {
namespace {

// next_dataset, next_model, next_job, next_selection: the next number of a resource. A number is
// part of a resource's name, so it is never used twice, not even after a deletion.
constexpr const char* kScenes =
    "CREATE TABLE scenes ("
    " id VARCHAR(63) PRIMARY KEY,"
    " display_name TEXT NOT NULL,"
    " request_id TEXT NOT NULL,"
    " create_time BIGINT NOT NULL,"
    " next_dataset BIGINT NOT NULL,"
    " next_model BIGINT NOT NULL)";
// A repeated request_id fails on these indexes if two servers handle it at the same time; "" means
// that the client gave none.
constexpr const char* kSceneRequests =
    "CREATE UNIQUE INDEX scene_requests ON scenes (request_id) WHERE request_id <> ''";

constexpr const char* kDatasets =
    "CREATE TABLE datasets ("
    " scene VARCHAR(63) NOT NULL REFERENCES scenes (id) ON DELETE CASCADE,"
    " number BIGINT NOT NULL,"
    " state INTEGER NOT NULL,"
    " request_id TEXT NOT NULL,"
    " create_time BIGINT NOT NULL,"
    " seal_time BIGINT NOT NULL,"
    " num_files BIGINT NOT NULL,"
    " num_bytes BIGINT NOT NULL,"
    " PRIMARY KEY (scene, number))";
constexpr const char* kDatasetRequests =
    "CREATE UNIQUE INDEX dataset_requests ON datasets (scene, request_id) WHERE request_id <> ''";

constexpr const char* kDatasetFiles =
    "CREATE TABLE dataset_files ("
    " scene VARCHAR(63) NOT NULL,"
    " dataset BIGINT NOT NULL,"
    " path TEXT NOT NULL,"
    " kind INTEGER NOT NULL,"
    " size BIGINT NOT NULL,"
    " sha256 VARCHAR(64) NOT NULL,"
    " stored INTEGER NOT NULL,"
    " PRIMARY KEY (scene, dataset, path),"
    " FOREIGN KEY (scene, dataset) REFERENCES datasets (scene, number) ON DELETE CASCADE)";

constexpr const char* kJobs =
    "CREATE TABLE jobs ("
    " number BIGINT PRIMARY KEY,"
    " scene VARCHAR(63) NOT NULL REFERENCES scenes (id) ON DELETE CASCADE,"
    " dataset BIGINT NOT NULL,"
    " state INTEGER NOT NULL,"
    " stage TEXT NOT NULL,"
    " options TEXT NOT NULL,"
    " effective_options TEXT NOT NULL,"
    " request_id TEXT NOT NULL,"
    " fence BIGINT NOT NULL,"
    " cancel_requested INTEGER NOT NULL,"
    " error_code INTEGER NOT NULL,"
    " error_message TEXT NOT NULL,"
    " model BIGINT NOT NULL,"
    " create_time BIGINT NOT NULL,"
    " start_time BIGINT NOT NULL,"
    " end_time BIGINT NOT NULL)";
constexpr const char* kJobRequests =
    "CREATE UNIQUE INDEX job_requests ON jobs (scene, request_id) WHERE request_id <> ''";
// Allows one active job per scene. State 0 is QUEUED, 1 is RUNNING.
constexpr const char* kActiveJobs =
    "CREATE UNIQUE INDEX active_jobs ON jobs (scene) WHERE state IN (0, 1)";
constexpr const char* kJobQueue = "CREATE INDEX job_queue ON jobs (state, number)";
constexpr const char* kJobNumbers = "CREATE TABLE job_numbers (next_job BIGINT NOT NULL)";
constexpr const char* kFirstJobNumber = "INSERT INTO job_numbers (next_job) VALUES (1)";

constexpr const char* kModels =
    "CREATE TABLE models ("
    " scene VARCHAR(63) NOT NULL REFERENCES scenes (id) ON DELETE CASCADE,"
    " number BIGINT NOT NULL,"
    " job TEXT NOT NULL,"
    " folder TEXT NOT NULL,"
    " metrics TEXT NOT NULL,"
    " num_gaussians BIGINT NOT NULL,"
    " num_bytes BIGINT NOT NULL,"
    " create_time BIGINT NOT NULL,"
    " PRIMARY KEY (scene, number))";

constexpr const char* kJobDevices = "ALTER TABLE jobs ADD COLUMN device TEXT NOT NULL DEFAULT ''";
constexpr const char* kModelDevices =
    "ALTER TABLE models ADD COLUMN device TEXT NOT NULL DEFAULT ''";

// counts: COCO's compressed run lengths.
constexpr const char* kLabels =
    "CREATE TABLE labels ("
    " scene VARCHAR(63) NOT NULL REFERENCES scenes (id) ON DELETE CASCADE,"
    " id VARCHAR(63) NOT NULL,"
    " text TEXT NOT NULL,"
    " view TEXT NOT NULL,"
    " width INTEGER NOT NULL,"
    " height INTEGER NOT NULL,"
    " counts TEXT NOT NULL,"
    " area BIGINT NOT NULL,"
    " request_id TEXT NOT NULL,"
    " create_time BIGINT NOT NULL,"
    " PRIMARY KEY (scene, id))";
constexpr const char* kLabelRequests =
    "CREATE UNIQUE INDEX label_requests ON labels (scene, request_id) WHERE request_id <> ''";

constexpr const char* kNextSelection =
    "ALTER TABLE scenes ADD COLUMN next_selection BIGINT NOT NULL DEFAULT 1";
// base: number of another selection of the scene, which may have been deleted; 0: none. The bounds
// are 0 if nothing is selected.
constexpr const char* kSelections =
    "CREATE TABLE selections ("
    " scene VARCHAR(63) NOT NULL,"
    " number BIGINT NOT NULL,"
    " model BIGINT NOT NULL,"
    " model_gaussians BIGINT NOT NULL,"
    " num_gaussians BIGINT NOT NULL,"
    " min_x DOUBLE PRECISION NOT NULL,"
    " min_y DOUBLE PRECISION NOT NULL,"
    " min_z DOUBLE PRECISION NOT NULL,"
    " max_x DOUBLE PRECISION NOT NULL,"
    " max_y DOUBLE PRECISION NOT NULL,"
    " max_z DOUBLE PRECISION NOT NULL,"
    " base BIGINT NOT NULL,"
    " file TEXT NOT NULL,"
    " request_id TEXT NOT NULL,"
    " request_digest TEXT NOT NULL,"
    " create_time BIGINT NOT NULL,"
    " PRIMARY KEY (scene, number),"
    " FOREIGN KEY (scene, model) REFERENCES models (scene, number) ON DELETE CASCADE)";
constexpr const char* kSelectionRequests =
    "CREATE UNIQUE INDEX selection_requests ON selections (scene, request_id)"
    " WHERE request_id <> ''";
// Without this index the deletion of a model would scan all selections.
constexpr const char* kSelectionModels =
    "CREATE INDEX selection_models ON selections (scene, model)";

constexpr const char* kModelSources =
    "ALTER TABLE models ADD COLUMN sources TEXT NOT NULL DEFAULT ''";

// Scenes belong to a project; older ones to "default".
constexpr const char* kSceneProjects =
    "ALTER TABLE scenes ADD COLUMN project VARCHAR(63) NOT NULL DEFAULT 'default'";
constexpr const char* kScenesByProject = "CREATE INDEX scenes_by_project ON scenes (project, id)";
// A request_id is unique within a project.
constexpr const char* kDropSceneRequests = "DROP INDEX scene_requests";
constexpr const char* kProjectSceneRequests =
    "CREATE UNIQUE INDEX scene_requests ON scenes (project, request_id) WHERE request_id <> ''";

// Quotas of 0 mean the server's default.
constexpr const char* kProjects =
    "CREATE TABLE projects ("
    " id VARCHAR(63) PRIMARY KEY,"
    " stored_bytes BIGINT NOT NULL,"
    " open_uploads BIGINT NOT NULL,"
    " queued_jobs BIGINT NOT NULL,"
    " running_jobs BIGINT NOT NULL,"
    " queries_per_second BIGINT NOT NULL,"
    " resident_bytes BIGINT NOT NULL,"
    " create_time BIGINT NOT NULL)";

// scopes: bit N is pepeseg.v1.Scope N. sha256: digest of the secret, lower-case hex.
constexpr const char* kKeys =
    "CREATE TABLE api_keys ("
    " id VARCHAR(16) PRIMARY KEY,"
    " project VARCHAR(63) NOT NULL,"
    " display_name TEXT NOT NULL,"
    " sha256 VARCHAR(64) NOT NULL UNIQUE,"
    " scopes INTEGER NOT NULL,"
    " create_time BIGINT NOT NULL,"
    " expire_time BIGINT NOT NULL,"
    " revoke_time BIGINT NOT NULL)";
constexpr const char* kKeysByProject = "CREATE INDEX keys_by_project ON api_keys (project, id)";

// For a RUNNING job: the server that holds it, the time from which another server may claim it, and
// the launcher's name for it.
constexpr const char* kJobLeaseOwner =
    "ALTER TABLE jobs ADD COLUMN lease_owner TEXT NOT NULL DEFAULT ''";
constexpr const char* kJobLeaseEnd =
    "ALTER TABLE jobs ADD COLUMN lease_end BIGINT NOT NULL DEFAULT 0";
constexpr const char* kJobTraces =
    "ALTER TABLE jobs ADD COLUMN traceparent VARCHAR(55) NOT NULL DEFAULT ''";
constexpr const char* kJobLaunch = "ALTER TABLE jobs ADD COLUMN launch TEXT NOT NULL DEFAULT ''";
// Attempts in a row without progress.
constexpr const char* kJobFruitless =
    "ALTER TABLE jobs ADD COLUMN fruitless INTEGER NOT NULL DEFAULT 0";
// Estimated host memory, bytes, and time, seconds. 0: not known.
constexpr const char* kJobHostBytes =
    "ALTER TABLE jobs ADD COLUMN host_bytes BIGINT NOT NULL DEFAULT 0";
constexpr const char* kJobSeconds = "ALTER TABLE jobs ADD COLUMN seconds BIGINT NOT NULL DEFAULT 0";

// Facts from a stored file's header (DatasetFileRow). header: 0 unread, 1 read, 2 refused.
constexpr const char* kFileHeaders =
    "ALTER TABLE dataset_files ADD COLUMN header INTEGER NOT NULL DEFAULT 0";
constexpr const char* kFileWidths =
    "ALTER TABLE dataset_files ADD COLUMN width INTEGER NOT NULL DEFAULT 0";
constexpr const char* kFileHeights =
    "ALTER TABLE dataset_files ADD COLUMN height INTEGER NOT NULL DEFAULT 0";
constexpr const char* kFilePoints =
    "ALTER TABLE dataset_files ADD COLUMN num_points BIGINT NOT NULL DEFAULT 0";
// The blobs on the disk that stored_bytes counts. They include blobs that no file names, until the
// collector has removed them.
constexpr const char* kBlobs =
    "CREATE TABLE blobs ("
    " project VARCHAR(63) NOT NULL,"
    " sha256 VARCHAR(64) NOT NULL,"
    " size BIGINT NOT NULL,"
    " PRIMARY KEY (project, sha256))";
constexpr const char* kBlobsOfFiles =
    "INSERT INTO blobs (project, sha256, size) SELECT s.project, f.sha256, MAX(f.size)"
    " FROM dataset_files f JOIN scenes s ON s.id = f.scene WHERE f.stored = 1"
    " GROUP BY s.project, f.sha256";
// Size of the selection's file.
constexpr const char* kSelectionBytes =
    "ALTER TABLE selections ADD COLUMN num_bytes BIGINT NOT NULL DEFAULT 0";
// The size of an older file follows from its format: 88 bytes of header and checksum, and a bit for
// each Gaussian of the model.
constexpr const char* kBytesOfSelections =
    "UPDATE selections SET num_bytes = 88 + (model_gaussians + 7) / 8";

// Attempts in a row without progress are counted separately: those whose worker crashed, and those
// whose server ended. The former column counted both, so its counts are reset.
constexpr const char* kJobCrashes = "ALTER TABLE jobs RENAME COLUMN fruitless TO crashes";
constexpr const char* kForgiveCrashes = "UPDATE jobs SET crashes = 0";
constexpr const char* kJobServerEnds =
    "ALTER TABLE jobs ADD COLUMN server_ends INTEGER NOT NULL DEFAULT 0";
// Earliest time at which a queued job is claimed.
constexpr const char* kJobNotBefore =
    "ALTER TABLE jobs ADD COLUMN not_before BIGINT NOT NULL DEFAULT 0";
// Scene ids become unique within a project only. scenes.id holds the key (server/store/scene_key.h)
// that all other tables refer to; scenes.name is the id that clients use. The key of an old scene
// is its id.
constexpr const char* kSceneNames =
    "ALTER TABLE scenes ADD COLUMN name VARCHAR(63) NOT NULL DEFAULT ''";
constexpr const char* kOldSceneNames = "UPDATE scenes SET name = id";
constexpr const char* kDropScenesByProject = "DROP INDEX scenes_by_project";
constexpr const char* kScenesByName =
    "CREATE UNIQUE INDEX scenes_by_name ON scenes (project, name)";
constexpr const char* kSceneNumbers = "CREATE TABLE scene_numbers (next_scene BIGINT NOT NULL)";
constexpr const char* kFirstSceneNumber = "INSERT INTO scene_numbers (next_scene) VALUES (1)";
constexpr const char* kDatabaseIdentity =
    "CREATE TABLE database_identity (id VARCHAR(32) NOT NULL)";
// A key is a number of up to 19 digits, '@' and an id.
constexpr const char* kLongSceneKey = "ALTER TABLE scenes ALTER COLUMN id TYPE VARCHAR(83)";
constexpr const char* kLongDatasetKey = "ALTER TABLE datasets ALTER COLUMN scene TYPE VARCHAR(83)";
constexpr const char* kLongFileKey =
    "ALTER TABLE dataset_files ALTER COLUMN scene TYPE VARCHAR(83)";
constexpr const char* kLongJobKey = "ALTER TABLE jobs ALTER COLUMN scene TYPE VARCHAR(83)";
constexpr const char* kLongModelKey = "ALTER TABLE models ALTER COLUMN scene TYPE VARCHAR(83)";
constexpr const char* kLongLabelKey = "ALTER TABLE labels ALTER COLUMN scene TYPE VARCHAR(83)";
constexpr const char* kLongSelectionKey =
    "ALTER TABLE selections ALTER COLUMN scene TYPE VARCHAR(83)";

}  // namespace

// SQLite does not enforce the length of VARCHAR, and cannot change a column's type.
std::vector<const char*> PostgresqlSchemaStep(int to) {
  if (to != 8) return {};
  return {kLongSceneKey, kLongDatasetKey, kLongFileKey,     kLongJobKey,
          kLongModelKey, kLongLabelKey,   kLongSelectionKey};
}

// A step that was released is never changed: databases in the field have run it. New columns have
// defaults, since old records get them.
std::vector<const char*> SchemaStep(int to) {
  assert(to >= 1 && to <= kSchemaVersion);
  if (to == 2) return {kJobDevices, kModelDevices};
  if (to == 3) {
    return {kLabels,     kLabelRequests,     kNextSelection,
            kSelections, kSelectionRequests, kSelectionModels};
  }
  if (to == 4) return {kModelSources};
  if (to == 5) {
    return {kSceneProjects,     kScenesByProject,
            kDropSceneRequests, kProjectSceneRequests,
            kProjects,          kKeys,
            kKeysByProject,     kJobLeaseOwner,
            kJobLeaseEnd,       kJobLaunch,
            kJobFruitless,      kJobHostBytes,
            kJobSeconds,        kJobTraces};
  }
  if (to == 6) {
    return {kFileHeaders, kFileWidths,   kFileHeights,    kFilePoints,
            kBlobs,       kBlobsOfFiles, kSelectionBytes, kBytesOfSelections};
  }
  if (to == 7) return {kJobCrashes, kForgiveCrashes, kJobServerEnds, kJobNotBefore};
  if (to == 8) {
    return {kSceneNames,   kOldSceneNames, kDropScenesByProject,
            kScenesByName, kSceneNumbers,  kFirstSceneNumber};
  }
  if (to == 9) return {kDatabaseIdentity};
  return {kScenes,      kSceneRequests, kDatasets, kDatasetRequests, kDatasetFiles,   kJobs,
          kJobRequests, kActiveJobs,    kJobQueue, kJobNumbers,      kFirstJobNumber, kModels};
}

}  // namespace pepeseg
