#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/store/rows.h"
#include "server/store/soci.h"

// What the store's parts share: columns to rows, checks inside a transaction, and pages.
namespace pepeseg {

// "project = 'PROJECT' AND ", or "" for all projects: a part of a list's query, of which
// placeholders would need a variable number. INVALID_ARGUMENT: no RFC 1034 label, which has nothing
// to escape.
absl::StatusOr<std::string> OfProject(const std::string& project);

// NOT_FOUND "scenes/ID does not exist".
absl::Status CheckScene(soci::session& sql, const std::string& scene);
absl::StatusOr<DatasetRow> SelectDataset(soci::session& sql, const std::string& scene,
                                         int64_t number);
absl::StatusOr<ModelRow> SelectModel(soci::session& sql, const std::string& scene, int64_t number);
absl::StatusOr<JobRow> SelectJob(soci::session& sql, const std::string& id);
// Rows whose `where` (with one placeholder) holds, at most `limit`, in `order`.
std::vector<JobRow> SelectJobs(soci::session& sql, const std::string& where_order, int64_t key,
                               int64_t limit);
// The scene's QUEUED or RUNNING job; its id is empty when there is none.
JobRow SelectActiveJob(soci::session& sql, const std::string& scene);

// Takes the next number out of a counter column of a scene.
int64_t TakeNumber(soci::session& sql, const std::string& scene, const std::string& column);

// Microseconds since 1970; 0 and InfinitePast stand for "not yet", the largest number and
// InfiniteFuture for "never".
int64_t ToMicros(absl::Time time);
absl::Time FromMicros(int64_t micros);

// A page token holds the list it belongs to and the key of the last row of the page before, so that
// one list's token is refused by another.
struct PageStart {
  int64_t limit = 0;
  std::string key;  // empty: from the start
};
absl::StatusOr<PageStart> StartPage(const std::string& list, const PageRequest& page);
// The number in a start's key, or `first` when there is none.
absl::StatusOr<int64_t> NumberKey(const PageStart& start, int64_t first);
std::string NextToken(const std::string& list, const std::string& key);

}  // namespace pepeseg
