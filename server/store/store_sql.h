#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/store/records.h"
#include "server/store/soci.h"

// SQL that several parts of the store use: reading records, checks inside a transaction, batches,
// pages. All functions that take a session throw what SOCI throws; Database catches it.
namespace pepeseg {

// Returns "project = 'PROJECT' AND ", or "" if `project` is empty, for a list's WHERE clause. It is
// part of the text because the number of placeholders would vary. INVALID_ARGUMENT: the project is
// not an RFC 1034 label; a label contains nothing to escape.
absl::StatusOr<std::string> OfProject(const std::string& project);

// Returns NOT_FOUND "scenes/{scene} does not exist" unless the scene exists.
absl::Status CheckScene(soci::session& sql, const SceneRef& scene);
// Return a record, or NOT_FOUND.
absl::StatusOr<DatasetRecord> SelectDataset(soci::session& sql, const SceneRef& scene,
                                            int64_t number);
absl::StatusOr<ModelRecord> SelectModel(soci::session& sql, const SceneRef& scene, int64_t number);
// Inserts a model, which becomes the live one of its scene.
void InsertModel(soci::session& sql, const ModelRecord& row);
absl::StatusOr<JobRecord> SelectJob(soci::session& sql, const std::string& id);
// Returns up to `limit` jobs. `where_order`: the query after WHERE, with one placeholder for `key`.
std::vector<JobRecord> SelectJobs(soci::session& sql, const std::string& where_order, int64_t key,
                                  int64_t limit);
// Returns the scene's QUEUED or RUNNING job; its id is empty if there is none.
JobRecord SelectActiveJob(soci::session& sql, const SceneRef& scene);

// Which files of a dataset to select: those for which `condition`, followed by `key`, holds.
struct FileQuery {
  SceneRef scene;
  int64_t dataset = 0;
  std::string condition = "path <>";  // by default all files, since no path is empty
  std::string key = {};
  int64_t limit = std::numeric_limits<int64_t>::max();
};
// Returns files ordered by path.
std::vector<DatasetFileRecord> SelectFiles(soci::session& sql, const FileQuery& query);
void InsertFiles(soci::session& sql, const DatasetRecord& dataset,
                 const std::vector<DatasetFileRecord>& files);
// Records that the files' bytes are on the disk as blobs of the project.
void InsertBlobs(soci::session& sql, const std::string& project,
                 const std::vector<DatasetFileRecord>& files);
// Marks files of a dataset as stored and sets what their headers say. NOT_FOUND: the dataset lacks
// one of them.
absl::Status MarkStored(soci::session& sql, const DatasetRecord& dataset,
                        const std::vector<DatasetFileRecord>& files);

// Runs one SQL statement for many records, with one round trip to the database for every 64 of
// them. For use inside one transaction; throws what SOCI throws.
class BatchStatement {
 public:
  using Value = std::variant<int64_t, std::string>;
  // The statement is `before`, then `record` for each record, joined by `between`, then `after`.
  // Each '?' in `record` is replaced by the next value of Add.
  struct Text {
    std::string before, record, between, after;
  };

  BatchStatement(soci::session& sql, Text text) : sql_(sql), text_(std::move(text)) {}
  // Adds a record's values, and runs the statement when 64 records are collected.
  void Add(std::vector<Value> record);
  // Runs what remains. Returns the number of records that all runs have changed.
  int64_t Finish();

 private:
  void Run();

  soci::session& sql_;
  const Text text_;
  std::vector<Value> values_;
  int num_records_ = 0;
  int64_t num_changed_ = 0;
};

// Increments a counter column of a scene and returns its old value.
int64_t TakeNumber(soci::session& sql, const SceneRef& scene, const std::string& column);

// Convert between absl::Time and a column of microseconds since 1970. 0 and InfinitePast mean "not
// yet"; the largest number and InfiniteFuture mean "never".
int64_t ToMicros(absl::Time time);
absl::Time FromMicros(int64_t micros);

// Where a page begins. A page token holds the name of its list and the key of the last record of
// the page before, so that another list refuses it.
struct PageStart {
  int64_t limit = 0;  // records per page
  std::string key;    // empty: from the start
};
// Reads a page request for the list named `list`. INVALID_ARGUMENT: a negative page_size, or a
// page_token of another list.
absl::StatusOr<PageStart> StartPage(const std::string& list, const PageRequest& page);
// Returns the number in a start's key, or `first` if the key is empty.
absl::StatusOr<int64_t> NumberKey(const PageStart& start, int64_t first);
// Returns the token for the page after a record with this key.
std::string NextToken(const std::string& list, const std::string& key);

}  // namespace pepeseg
