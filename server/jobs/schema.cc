#include "server/jobs/schema.h"

#include <cassert>

namespace pepeseg {
namespace {

// next_dataset, next_model, next_job, next_selection: numbers name resources, so they are never
// given twice, not even after a deletion.
constexpr const char* kScenes =
    "CREATE TABLE scenes ("
    " id VARCHAR(63) PRIMARY KEY,"
    " display_name TEXT NOT NULL,"
    " request_id TEXT NOT NULL,"
    " create_time BIGINT NOT NULL,"
    " next_dataset BIGINT NOT NULL,"
    " next_model BIGINT NOT NULL)";
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
// One active training per scene: 0 is QUEUED, 1 RUNNING.
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
// base: number of another selection of the scene, which may be deleted since; 0: none. The bounds
// are 0 where nothing is selected.
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
// Without it a model's deletion looks at every selection.
constexpr const char* kSelectionModels =
    "CREATE INDEX selection_models ON selections (scene, model)";

constexpr const char* kModelSources =
    "ALTER TABLE models ADD COLUMN sources TEXT NOT NULL DEFAULT ''";

}  // namespace

std::vector<const char*> SchemaStep(int to) {
  assert(to >= 1 && to <= kSchemaVersion);
  if (to == 2) return {kJobDevices, kModelDevices};
  if (to == 3) {
    return {kLabels,     kLabelRequests,     kNextSelection,
            kSelections, kSelectionRequests, kSelectionModels};
  }
  if (to == 4) return {kModelSources};
  return {kScenes,      kSceneRequests, kDatasets, kDatasetRequests, kDatasetFiles,   kJobs,
          kJobRequests, kActiveJobs,    kJobQueue, kJobNumbers,      kFirstJobNumber, kModels};
}

}  // namespace pepeseg
