#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/store/records.h"

namespace pepeseg {

class Database;

// Datasets and uploads. An upload is a dataset that is still open. See Store for what holds for all
// calls; FileStore has the files.
class DatasetStore {
 public:
  DatasetStore(Database& database, const Quota& defaults)
      : database_(database), defaults_(defaults) {}

  // Creates an open dataset: an upload. `files` must have distinct paths and are not checked
  // further; `stored` of each says whether the project has the bytes already. `admit` decides
  // whether a new dataset may be made; it is not asked about one that the request_id made earlier,
  // and may be called more than once. RESOURCE_EXHAUSTED: the project's quota of stored bytes or
  // open uploads.
  absl::StatusOr<DatasetRecord> CreateDataset(const SceneRef& scene, const std::string& request_id,
                                              const std::vector<DatasetFileRecord>& files,
                                              const std::function<absl::Status()>& admit = {});
  absl::StatusOr<DatasetRecord> GetDataset(const SceneRef& scene, int64_t number);
  // Lists sealed datasets by number.
  absl::StatusOr<Page<DatasetRecord>> ListDatasets(const SceneRef& scene, const PageRequest& page);
  // Marks `found` as stored (files whose bytes came by another upload) and seals the dataset.
  // FAILED_PRECONDITION: files are not stored; names the first of them and their number. Sealing a
  // sealed dataset changes nothing.
  absl::StatusOr<DatasetRecord> SealDataset(const SceneRef& scene, int64_t number,
                                            const std::vector<DatasetFileRecord>& found = {});

  // Returns the open uploads that were created before a time.
  absl::StatusOr<std::vector<DatasetRecord>> ListOpenUploads(absl::Time created_before);
  // Deletes an upload with its files. FAILED_PRECONDITION: it is sealed.
  absl::Status DeleteUpload(const SceneRef& scene, int64_t number);

 private:
  Database& database_;
  const Quota& defaults_;  // limits of projects without values of their own
};

}  // namespace pepeseg
