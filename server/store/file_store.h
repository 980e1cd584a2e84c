#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/layout.h"
#include "server/store/records.h"

namespace pepeseg {

class Database;

// Files of datasets, and the records of the blobs that hold their bytes. See Store for what holds
// for all calls.
class FileStore {
 public:
  explicit FileStore(Database& database) : database_(database) {}

  // Returns all files, ordered by path.
  absl::StatusOr<std::vector<DatasetFileRecord>> ListDatasetFiles(const SceneRef& scene,
                                                                  int64_t number);
  absl::StatusOr<DatasetFileRecord> GetDatasetFile(const SceneRef& scene, int64_t number,
                                                   const std::string& path);
  // Returns whether a dataset has a file of `kind` (pepeseg.v1.FileKind); false if the dataset does
  // not exist.
  absl::StatusOr<bool> HasFileOfKind(const SceneRef& scene, int64_t number, int kind);
  // Returns up to `limit` files with paths >= `path`, ordered by path; none if the dataset does not
  // exist.
  absl::StatusOr<std::vector<DatasetFileRecord>> ListDatasetFilesFrom(const SceneRef& scene,
                                                                      int64_t number,
                                                                      const std::string& path,
                                                                      int64_t limit);
  // Records that the bytes of `files` are on the disk as blobs of the project. Reads path, sha256,
  // size and what the header says. FAILED_PRECONDITION: the upload is sealed. NOT_FOUND: it is
  // gone, or lacks one of the files. The blobs count in the project's usage even after these two
  // errors, since they are on the disk.
  absl::Status MarkFilesStored(const UploadName& upload,
                               const std::vector<DatasetFileRecord>& files);
  // Stores what the files' headers say.
  absl::Status SetFileHeaders(const SceneRef& scene, int64_t number,
                              const std::vector<DatasetFileRecord>& files);
  // Sets `stored` of every file of the project with one of these digests, in sealed datasets too:
  // false when its bytes were found damaged, true when they were uploaded again. The headers of
  // these files become unread.
  absl::Status SetDigestsStored(const std::string& project, const std::vector<std::string>& digests,
                                bool stored);

  // Returns the digests of all files in datasets and uploads of the project.
  absl::StatusOr<std::set<std::string>> ListDigests(const std::string& project);
  // Returns the digests of all blobs that count in the project's usage.
  absl::StatusOr<std::set<std::string>> ListBlobs(const std::string& project);
  // Returns the projects that have such blobs, by name.
  absl::StatusOr<std::vector<std::string>> ListBlobProjects();
  // Records that these blobs are no longer on the disk.
  absl::Status ForgetBlobs(const std::string& project, const std::vector<std::string>& digests);

 private:
  Database& database_;
};

}  // namespace pepeseg
